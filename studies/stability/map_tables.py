"""The tables of a map: a CSV file with a row per cell, and a JSON file with its boundaries and what it comes from."""

import json
from pathlib import Path
from typing import Any

from ...orchestrator.results.table import csv_line
from ...orchestrator.results.whole import write_whole
from ..point import value_text
from .counts import apart, counted
from .map import Cell, Panel, StabilityMap


def write_tables(stability: StabilityMap, folder: Path, stem: str = "stability") -> None:
    """Write both files to `folder`, called after `stem`; what is not known stays empty."""
    measures = list(dict.fromkeys(name for cell in stability.cells for name in cell.errors))
    rows = [_columns(measures)]
    rows += [_cells(panel, cell, measures) for panel in stability.panels for cell in panel.cells]
    write_whole(folder / f"{stem}.csv", b"".join(map(csv_line, rows)))
    write_whole(folder / f"{stem}.json", f"{json.dumps(_content(stability), indent=2, allow_nan=False)}\n".encode())


def _columns(measures: list[str]) -> list[str]:
    known = ["x", "y", "class", "reason", "measure", "predicted", "line", "bisected", "wall_s", "cpu_s"]
    return [*known, *(f"error_{name}" for name in measures), "folder"]


def _cells(panel: Panel, cell: Cell, measures: list[str]) -> list[Any]:
    trial = cell.trial
    return [
        value_text(cell.x),
        value_text(cell.y),
        cell.kind,
        cell.reason,
        "" if cell.measure is None else cell.measure,
        "" if cell.predicted is None else cell.predicted,
        panel.name,
        int(cell.bisected),
        *(["", ""] if trial is None or not trial.costs else [trial.wall_s, trial.cpu_s]),
        *(cell.errors.get(name, "") for name in measures),
        "" if trial is None else trial.folder.name,
    ]


def _content(stability: StabilityMap) -> dict[str, Any]:
    return {
        "study": stability.name,
        "scenario": stability.scenario,
        "theory": stability.theory,
        "formula": stability.formula,
        "tolerances": dict(stability.tolerances),
        "references": list(stability.references),
        "counts": counted(stability.cells),
        "lines": {panel.name: _panel(panel) for panel in stability.panels},
        "machine": dict(stability.machine),
        "versions": dict(stability.versions),
        "notes": list(stability.notes),
    }


def _panel(panel: Panel) -> dict[str, Any]:
    return {
        "x": panel.x_key,
        "y": panel.y_key,
        "counts": counted(panel.cells),
        "crossings": [
            {
                "x": crossing.x,
                "low": crossing.low,
                "high": crossing.high,
                "measured": crossing.measured,
                "predicted": crossing.predicted,
                "difference": apart(crossing),
            }
            for crossing in panel.crossings
        ],
        "limit": [[list(point) for point in piece] for piece in panel.limit],
    }
