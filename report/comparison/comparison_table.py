"""comparison.csv: every difference between runs, a row each."""

import csv
import io
from dataclasses import asdict, fields
from math import isfinite
from pathlib import Path

from ...orchestrator.results.whole import write_whole
from .differences import Differences, Row

COMPARISON_CSV = "comparison.csv"

_COLUMNS = ("run", "quantity", "unit", "reference", "value", "difference", "time_ms", "description", "why")


def write_table(found: Differences, folder: Path) -> Path:
    """Write comparison.csv into `folder`; returns the file. Its columns are the fields of `Row`."""
    text = io.StringIO()
    writer = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    for row in [*found.headlines, *found.measured]:
        writer.writerow({name: _cell(value) for name, value in asdict(row).items()})
    path = folder / COMPARISON_CSV
    write_whole(path, text.getvalue().encode())
    return path


def _cell(value: str | float | None) -> str:
    if isinstance(value, float):
        return repr(value) if isfinite(value) else ("" if value != value else "inf")
    return "" if value is None else value


if {field.name for field in fields(Row)} != set(_COLUMNS):
    raise TypeError("the columns of comparison.csv are not the fields of its rows")
