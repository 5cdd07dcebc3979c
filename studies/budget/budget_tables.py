"""errors.csv, a row per source and quantity, and errors.json, the budget in words."""

import csv
import io
import json
from math import isfinite
from pathlib import Path

from ...orchestrator.results.whole import write_whole
from .budget import Budget
from .sentences import sentences

COLUMNS = ("source", "quantity", "value", "estimate", "order", "trusted", "reason", "finer")


def write_tables(budget: Budget, csv_path: Path, json_path: Path) -> None:
    """Write both files."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for quantity in budget.quantities:
        for each in quantity.contributions:
            estimate = repr(each.estimate) if isfinite(each.estimate) else ""
            order = "" if each.order is None else f"{each.order:.3g}"
            trusted = int(each.trusted)
            writer.writerow(
                [each.source, each.quantity, repr(each.value), estimate, order, trusted, each.reason, each.finer]
            )
    write_whole(csv_path, text.getvalue().encode())
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
