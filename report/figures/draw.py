"""All figures of a results folder."""

import io
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.results.whole import write_whole
from ..heading import heading_of
from .cavity_volumes import cavity_volumes
from .cell_response import cell_response
from .fiber_layout import fiber_layout
from .heart_potential import heart_potential
from .other_outputs import other_outputs
from .pressure_volume import pressure_volume
from .probe_potential import probe_potential
from .residuals import residuals
from .space_time import space_time
from .wall_motion import wall_motion

#: Each figure by its file name; one that finds no data in the run returns None.
FIGURES: dict[str, Callable[[StoredRun], Figure | None]] = {
    "fiber_layout": fiber_layout,
    "potential_on_deformed_heart": heart_potential,
    "potential_at_probes": probe_potential,
    "cavity_volumes": cavity_volumes,
    "pressure_volume": pressure_volume,
    "wall_motion": wall_motion,
    "cell_response": cell_response,
    "potential_along_the_strand": space_time,
    "other_outputs": other_outputs,
    "residuals": residuals,
}

_DOTS_PER_INCH = 160

#: Of a heading, at least.
_LETTERS_PER_INCH = 12


#: Those that show only what does not change over a run.
_STILL = ("fiber_layout",)


def draw_still(folder: Path, heading: str) -> dict[str, bytes]:
    """The pictures of what does not change over the run in `folder`, by name, as far as there is data for them.

    `heading` is that of the run, whose summary is not there yet.
    """
    run = StoredRun(folder)
    figures = {name: FIGURES[name](run) for name in _STILL}
    return {name: _picture(figure, heading) for name, figure in figures.items() if figure is not None}


def draw_figures(folder: Path, still: Mapping[str, bytes] | None = None) -> list[Path]:
    """Draw every figure that the results in `folder` have the data for; returns the files in `folder`/figures.

    `still` are pictures that were drawn when the run began.

    A figure without data is skipped, and its file from an earlier run in the same folder is removed: what lies in
    `figures` always belongs to the results next to it.
    """
    run = StoredRun(folder)
    drawn = []
    for name, draw in FIGURES.items():
        path = folder / "figures" / f"{name}.png"
        picture = None if still is None else still.get(name)
        if picture is None:
            figure = draw(run)
            picture = None if figure is None else _picture(figure, heading_of(run))
        if picture is None:
            path.unlink(missing_ok=True)
            continue
        path.parent.mkdir(exist_ok=True)
        write_whole(path, picture)
        drawn.append(path)
    return drawn


def _picture(figure: Figure, heading: str) -> bytes:
    FigureCanvasAgg(figure)
    lines = textwrap.fill(heading, int(_LETTERS_PER_INCH * figure.get_figwidth()))
    figure.suptitle(lines, fontsize=11, x=0.01, ha="left")
    figure.align_ylabels()
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DOTS_PER_INCH)
    return content.getvalue()
