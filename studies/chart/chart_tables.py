"""The tables of a chart: a CSV file with a row per point, and a JSON file with what the numbers come from."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

from ...orchestrator.results.table import csv_line
from ...orchestrator.results.whole import write_whole
from ..point import value_text
from .chart import Chart, Row


def write_tables(chart: Chart, folder: Path, stem: str = "chart") -> None:
    """Write both files to `folder`, called after `stem`."""
    rows = [_columns(chart), *([line.name, *_cells(chart, row)] for line in chart.lines for row in line.rows)]
    write_whole(folder / f"{stem}.csv", b"".join(map(csv_line, rows)))
    write_whole(folder / f"{stem}.json", f"{json.dumps(_content(chart), indent=2)}\n".encode())


def _columns(chart: Chart) -> list[str]:
    names = [measure.name for measure in chart.measures]
    return [
        "line",
        *chart.varied,
        "status",
        "reason",
        *(f"error_{name}" for name in names),
        "wall_s",
        "wall_spread_s",
        "runs",
        "cpu_s",
        *(f"cpu_s_{unit}" for unit in chart.units),
        *(f"solves_{unit}" for unit in chart.units),
        "sweeps",
        *(f"front_{name}" for name in names),
        *(["meets", *(f"margin_{name}" for name in chart.limits)] if chart.limits else []),
        "folder",
    ]


def _cells(chart: Chart, row: Row) -> list[Any]:
    """What is not known stays empty."""
    settings = [_setting(row, key) for key in chart.varied]
    errors = [row.errors.get(measure.name, "") for measure in chart.measures]
    trial = row.trial
    if trial is None or not row.is_done:
        front = [0] * len(chart.measures)
        costs: list[Any] = [""] * (5 + 2 * len(chart.units))
        folder = "" if trial is None else trial.folder.name
        return [*settings, row.status, row.reason, *errors, *costs, *front, *_margins(chart, row), folder]
    costs = [trial.wall_s, trial.wall_spread_s, len(trial.costs), trial.cpu_s]
    costs += [trial.unit_cpu_s(unit) if unit in trial.solves else "" for unit in chart.units]
    costs += [trial.solves.get(unit, "") for unit in chart.units]
    front = [int(measure.name in row.front) for measure in chart.measures]
    costs.append(trial.sweeps)
    return [*settings, row.status, row.reason, *errors, *costs, *front, *_margins(chart, row), trial.folder.name]


def _margins(chart: Chart, row: Row) -> list[Any]:
    """Whether all limits are kept, and what part of each is left; less than nothing where it is exceeded."""
    if not chart.limits:
        return []
    if not row.is_done:
        return ["", *("" for _ in chart.limits)]
    left = [1.0 - row.errors[name] / limit if name in row.errors else "" for name, limit in chart.limits.items()]
    return [int(row.worst(chart.limits) <= 1.0), *left]


def _setting(row: Row, key: str) -> str:
    """A varied value; of a line that does not vary the key what its scenario has there, if it says anything."""
    value = row.settings.get(key, row.value(key))
    return value_text(value) if key in row.settings or value is not None else ""


def _content(chart: Chart) -> dict[str, Any]:
    return {
        "study": chart.name,
        "scenario": chart.scenario,
        "cost": chart.cost,
        "machine": dict(chart.machine),
        "versions": dict(chart.versions),
        "reference": list(chart.references),
        "uncertainty": {name: value if isfinite(value) else None for name, value in chart.uncertainty.items()},
        "measures": {measure.name: {"unit": measure.unit, "what": measure.description} for measure in chart.measures},
        "orders": {line.name: dict(line.orders) for line in chart.lines},
        "notes": list(chart.notes),
        **({"limits": dict(chart.limits)} if chart.limits else {}),
    }
