"""All figures of a results folder."""

from collections.abc import Callable
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..whole import replacing
from .fiber_layout import fiber_layout
from .heart_potential import heart_potential
from .lines import cavity_volumes, probe_potential
from .stored_run import StoredRun

#: Each figure by its file name; one that finds no data in the run returns None.
FIGURES: dict[str, Callable[[StoredRun], Figure | None]] = {
    "fiber_layout": fiber_layout,
    "potential_on_deformed_heart": heart_potential,
    "potential_at_probes": probe_potential,
    "cavity_volumes": cavity_volumes,
}

_DOTS_PER_INCH = 160


def draw_figures(folder: Path) -> list[Path]:
    """Draw every figure that the results in `folder` have the data for; returns the files in `folder`/figures.

    A figure without data is skipped, and its file from an earlier run in the same folder is removed: what lies in
    `figures` always belongs to the results next to it.
    """
    run = StoredRun(folder)
    drawn = []
    for name, draw in FIGURES.items():
        path = folder / "figures" / f"{name}.png"
        figure = draw(run)
        if figure is None:
            path.unlink(missing_ok=True)
            continue
        path.parent.mkdir(exist_ok=True)
        FigureCanvasAgg(figure)
        with replacing(path) as part:
            figure.savefig(part, format="png", dpi=_DOTS_PER_INCH)
        drawn.append(path)
    return drawn
