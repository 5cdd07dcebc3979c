"""All figures of a results folder."""

import io
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.results.whole import write_whole
from ..heading import heading_of
from .activation_map import activation_map
from .boundaries import boundaries
from .cavity_volumes import cavity_volumes
from .cell_response import cell_response
from .displacement_snapshots import displacement_snapshots
from .fiber_layout import fiber_layout
from .geometry import geometry
from .other_outputs import other_outputs
from .potential_snapshots import potential_snapshots
from .pressure_volume import pressure_volume
from .probe_potential import probe_potential
from .residuals import residuals
from .space_time import space_time
from .stimulus import stimulus
from .transmural_directions import transmural_directions
from .wall_motion import wall_motion

#: Each figure by its file name; one that finds no data in the run returns None.
FIGURES: dict[str, Callable[[StoredRun], Figure | None]] = {
    # In space.
    "geometry": geometry,
    "boundaries": boundaries,
    "transmural_directions": transmural_directions,
    "fiber_layout": fiber_layout,
    "stimulus": stimulus,
    "potential_snapshots": potential_snapshots,
    "displacement_snapshots": displacement_snapshots,
    "activation_map": activation_map,
    # Curves.
    "potential_at_probes": probe_potential,
    "cavity_volumes": cavity_volumes,
    "pressure_volume": pressure_volume,
    "wall_motion": wall_motion,
    "cell_response": cell_response,
    "potential_along_the_strand": space_time,
    "other_outputs": other_outputs,
    "residuals": residuals,
}

#: Those that show only what is known when a run begins.
_STILL = ("geometry", "boundaries", "transmural_directions", "fiber_layout", "stimulus")

#: Those whose frames can be asked for.
_IN_FRAMES: dict[str, Callable[[StoredRun, Sequence[float]], Figure | None]] = {
    "potential_snapshots": potential_snapshots,
    "displacement_snapshots": displacement_snapshots,
}

#: Pixels across a picture.
_ACROSS = 1280

#: Letters of a heading that an inch holds, at least.
_LETTERS_PER_INCH = 10

#: Height of a line of it.
_LINE_IN = 0.19


def draw_still(folder: Path, heading: str) -> dict[str, bytes]:
    """The pictures of what does not change over the run in `folder`, by name, as far as there is data for them.

    `heading` is that of the run, whose summary is not there yet.
    """
    run = StoredRun(folder)
    figures = {name: FIGURES[name](run) for name in _STILL}
    return {name: _picture(figure, heading) for name, figure in figures.items() if figure is not None}


def draw_figures(folder: Path, still: Mapping[str, bytes] | None = None, times_ms: Sequence[float] = ()) -> list[Path]:
    """Draw every figure that the results in `folder` have the data for; returns the files in `folder`/figures.

    `still` are pictures that were drawn when the run began. `times_ms` are the times whose nearest frames are shown in
    place of those that are chosen by what happens.

    A figure without data is skipped, and its file from an earlier run in the same folder is removed: what lies in
    `figures` always belongs to the results next to it.

    Raises
    ------
    InputError
        For a time outside the run.
    """
    run = StoredRun(folder)
    drawn = []
    for name, draw in FIGURES.items():
        path = folder / "figures" / f"{name}.png"
        picture = None if still is None else still.get(name)
        if picture is None:
            figure = _IN_FRAMES[name](run, times_ms) if name in _IN_FRAMES else draw(run)
            picture = None if figure is None else _picture(figure, heading_of(run))
        if picture is None:
            path.unlink(missing_ok=True)
            continue
        path.parent.mkdir(exist_ok=True)
        write_whole(path, picture)
        drawn.append(path)
    return drawn


def _picture(figure: Figure, heading: str) -> bytes:
    """The figure as a PNG file, with the heading above it in as many lines as it takes."""
    FigureCanvasAgg(figure)
    width, height = figure.get_size_inches()
    lines = textwrap.wrap(heading, int(_LETTERS_PER_INCH * width))
    # Figures have room for a heading of one line.
    figure.set_figheight(height + _LINE_IN * (len(lines) - 1))
    figure.suptitle("\n".join(lines), fontsize=11, fontweight="bold", x=0.01, ha="left")
    figure.align_ylabels()
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_ACROSS / width)
    return content.getvalue()
