"""What tests of figures share: a cube of tetrahedra, and results in a folder as a run would leave them."""

import json
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
from cardiac_cosim.orchestrator.participants.participant import Values
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from matplotlib.figure import Figure
from numpy.typing import NDArray

#: A cube of 10 mm made of six tetrahedra around its diagonal.
CUBE_POINTS = 10.0 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
CUBE_CELLS = np.array([[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]])


def stored(
    folder: Path,
    points: Values = CUBE_POINTS,
    cells: NDArray[np.int64] = CUBE_CELLS,
    *,
    times: tuple[float, ...] = (),
    fixed: Mapping[str, Values] | None = None,
    frames: Mapping[str, Values] | None = None,
    boundaries: Mapping[str, NDArray[np.int64]] | None = None,
    series: str = "",
    **summary: object,
) -> StoredRun:
    """A run of these fields, time series and summary; `frames` are arrays of shape (frames, nodes or elements, ...)."""
    with h5py.File(folder / "fields.h5", "w") as file:
        file["points_mm"], file["cells"], file["frames_ms"] = points, cells, np.array(times, dtype=float)
        for name, values in {
            **(fixed or {}),
            **{f"frames/{name}": values for name, values in (frames or {}).items()},
        }.items():
            file[name] = values
        for name, faces in (boundaries or {}).items():
            file[f"boundaries/{name}"] = faces
    if series:
        (folder / "timeseries.csv").write_text(series, encoding="utf-8")
    if summary:
        (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    return StoredRun(folder)


def drawn(figure: Figure | None) -> Figure:
    """The figure, which has to be there."""
    assert figure is not None
    return figure


def titles(figure: Figure) -> list[str]:
    """What stands above its panels, each in one line."""
    return [axis.get_title().replace("\n", " ") for axis in figure.axes if axis.get_title()]
