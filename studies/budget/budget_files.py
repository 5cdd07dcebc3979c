"""A budget in its folder: tables and figures."""

from pathlib import Path

from ...orchestrator.results.names import BUDGET_CSV, BUDGET_JSON, BUDGET_PNG, BUDGET_SVG
from ..pictures.picture_files import write_pictures
from .bars import draw_budget
from .budget import Budget
from .budget_tables import write_tables


def write_budget(budget: Budget, folder: Path) -> None:
    """Write errors.csv, errors.json, errors.png and errors.svg to `folder`."""
    write_tables(budget, folder / BUDGET_CSV, folder / BUDGET_JSON)
    paths = {"png": folder / BUDGET_PNG, "svg": folder / BUDGET_SVG}
    write_pictures(draw_budget(budget), paths, {"hashsalt": budget.name, "fonttype": "none"})
