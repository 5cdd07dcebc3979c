"""A budget in its folder: tables and figures."""

import io
from pathlib import Path

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ...orchestrator.results.names import BUDGET_CSV, BUDGET_JSON, BUDGET_PNG, BUDGET_SVG
from ...orchestrator.results.whole import write_whole
from .bars import draw_budget
from .budget import Budget
from .budget_tables import write_tables

_DOTS_PER_INCH = 160


def write_budget(budget: Budget, folder: Path) -> None:
    """Write errors.csv, errors.json, errors.png and errors.svg to `folder`."""
    write_tables(budget, folder / BUDGET_CSV, folder / BUDGET_JSON)
    figure = draw_budget(budget)
    FigureCanvasAgg(figure)
    for name, kind in ((BUDGET_PNG, "png"), (BUDGET_SVG, "svg")):
        content = io.BytesIO()
        # The same budget gives the same file.
        with matplotlib.rc_context({"svg.hashsalt": budget.name, "svg.fonttype": "none"}):
            figure.savefig(content, format=kind, dpi=_DOTS_PER_INCH, metadata={"Date": None} if kind == "svg" else None)
        write_whole(folder / name, content.getvalue())
