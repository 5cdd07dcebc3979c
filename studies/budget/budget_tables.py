"""errors.csv, a row per source and quantity, and errors.json, the budget in words."""

import json
from math import isfinite
from pathlib import Path

from ...orchestrator.results.table import csv_line
from ...orchestrator.results.whole import write_whole
from .budget import Budget, Contribution
from .sentences import sentences

COLUMNS = ("source", "quantity", "value", "estimate", "order", "trusted", "reason", "finer")


def write_tables(budget: Budget, csv_path: Path, json_path: Path) -> None:
    """Write both files."""
    rows = [COLUMNS, *(_cells(each) for quantity in budget.quantities for each in quantity.contributions)]
    write_whole(csv_path, b"".join(map(csv_line, rows)))
    content = {
        "scenario": budget.name,
        "sentences": sentences(budget),
        "sources": {
            source.name: {"finer": source.refined, "order_in": source.quantity, "divided_by": source.ratio}
            for source in budget.sources
        },
        "notes": list(budget.notes),
    }
    write_whole(json_path, f"{json.dumps(content, indent=2, ensure_ascii=False)}\n".encode())


def _cells(each: Contribution) -> list[str | float]:
    estimate = each.estimate if isfinite(each.estimate) else ""
    order = "" if each.order is None else f"{each.order:.3g}"
    return [each.source, each.quantity, each.value, estimate, order, int(each.trusted), each.reason, each.finer]
