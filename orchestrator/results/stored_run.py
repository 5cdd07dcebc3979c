"""Read back what a run left in its results folder: the one reader for figures, studies, benchmarks and notebooks."""

import csv
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..participants.participant import Values
from .boundaries import read_boundaries
from .names import COUPLING, FIELDS, SUMMARY, TIME_SERIES

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Body:
    """The undeformed tetrahedra: `points` in mm, shape (nodes, 3), and the nodes of `cells`, shape (elements, 4).

    What the units check of their mesh is not checked again, and their floor need not be loaded for it.
    """

    points: Values
    cells: NDArray[np.int64]

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.cells)

    @cached_property
    def centroids(self) -> Values:
        """Of the elements, in mm, shape (elements, 3)."""
        return np.asarray(self.points[self.cells].mean(axis=1))

    @cached_property
    def volumes(self) -> Values:
        """Of the elements, in mm³, shape (elements,)."""
        edges = self.points[self.cells[:, 1:]] - self.points[self.cells[:, :1]]
        return np.asarray(np.linalg.det(edges) / 6.0)


class StoredRun:
    """The results in `folder`; whatever is missing there reads as empty or None, never as an error.

    Attributes
    ----------
    mesh:
        The undeformed body; None without fields.h5 and for scenes of other elements.
    boundaries:
        The faces of the mesh's named boundaries by their nodes, each of shape (faces, dimension): of a solid triangles
        whose normals point out of the tissue. Empty where there are none, and for runs of versions that kept none.
    frames_ms:
        Times of the stored frames, shape (frames,).
    columns:
        The numbers of the time series by column name, each of shape (rows,); an empty cell is NaN.
    summary:
        The content of summary.json.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._fields = self.folder / FIELDS

    @cached_property
    def summary(self) -> dict[str, Any]:
        """See the class."""
        try:
            content = json.loads((self.folder / SUMMARY).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    @property
    def settings(self) -> dict[str, Any]:
        """The keys of the scenario that were set to other values than its file has, with these values."""
        request = self.summary.get("request")
        settings = request.get("settings") if isinstance(request, dict) else None
        return settings if isinstance(settings, dict) else {}

    def time_series(self) -> "pandas.DataFrame":
        """The time series as a data frame, texts included, indexed by `time_ms`; empty where there is none."""
        return _frame(self.folder / TIME_SERIES)

    def coupling(self) -> "pandas.DataFrame":
        """The coupling log as a data frame, a row per accepted step, indexed by `time_ms`; empty if there is none."""
        return _frame(self.folder / COUPLING)

    @cached_property
    def cells(self) -> NDArray[np.int64] | None:
        """The nodes of the elements of any scene, shape (elements, dimension + 1)."""
        cells = self._read("cells")
        return None if cells is None else cells.astype(np.int64)

    @cached_property
    def mesh(self) -> Body | None:
        """See the class."""
        points, cells = self.points_mm, self.cells
        if points is None or cells is None or cells.shape[1] != 4:
            return None
        return Body(points, cells)

    @cached_property
    def frames_ms(self) -> Values:
        """See the class."""
        times = self._read("frames_ms")
        return np.empty(0) if times is None else times

    @cached_property
    def columns(self) -> dict[str, Values]:
        """See the class."""
        return _numbers(self.folder / TIME_SERIES)

    def numbers(self, name: str) -> dict[str, Values]:
        """The columns of numbers of another table in the folder, as `columns`; empty where there is none."""
        return _numbers(self.folder / name)

    @cached_property
    def points_mm(self) -> Values | None:
        """The undeformed nodes of any scene, shape (nodes, 3)."""
        return self._read("points_mm")

    @cached_property
    def boundaries(self) -> dict[str, NDArray[np.int64]]:
        """See the class."""
        if not self._fields.exists():
            return {}
        with h5py.File(self._fields, "r") as file:
            return read_boundaries(file)

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The names of the fields that have frames, with their units of measure."""
        if not self._fields.exists():
            return ()
        with h5py.File(self._fields, "r") as file:
            return tuple(file["frames"]) if "frames" in file else ()

    @property
    def end_ms(self) -> float:
        """Time of the last accepted step, or of the last frame where there is no time series; −inf for neither."""
        return float(max([*self.columns.get("time_ms", ()), *self.frames_ms], default=-np.inf))

    def initial(self, name: str) -> Values | None:
        """A fixed field, or the first frame of one that changes; None if there is none of that name."""
        fixed = self._read(name)
        return self.frame(name, 0) if fixed is None else fixed

    def frame(self, name: str, number: int) -> Values | None:
        """A changing field in a frame, shape (nodes or elements, ...); None if there is none."""
        return self._read(f"frames/{name}", number)

    def frames(self, name: str, every: int = 1) -> Values | None:
        """A changing field in every so-many-th frame, shape (frames, nodes or elements, ...); None if there is none."""
        return self._read(f"frames/{name}", slice(None, None, every))

    def _read(self, name: str, row: int | slice | None = None) -> Values | None:
        """A data set or rows of it. Where units share a name, `unit.name` of the first unit is read."""
        if not self._fields.exists():
            return None
        with h5py.File(self._fields, "r") as file:
            group, _, last = name.rpartition("/")
            if group not in ("", *file):
                return None
            within = file[group] if group else file
            found = [key for key in within if key == last or key.endswith(f".{last}")]
            if not found or (isinstance(row, int) and row >= len(within[found[0]])):
                return None
            values = within[found[0]]
            return np.asarray(values[:] if row is None else values[row])


def _numbers(path: Path) -> dict[str, Values]:
    """The columns of numbers of a CSV file by name; columns that hold texts are left out."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    # A run that was killed may leave half a row at the end.
    complete = [row for row in rows if len(row) == len(header)]
    found = {}
    for place, name in enumerate(header):
        try:
            found[name] = np.array([float(row[place]) if row[place] else np.nan for row in complete])
        except ValueError:
            continue
    return found


def _frame(path: Path) -> "pandas.DataFrame":
    # Imported here: who draws or compares need not wait for it.
    import pandas

    if not path.exists():
        return pandas.DataFrame()
    return pandas.read_csv(path, index_col="time_ms")
