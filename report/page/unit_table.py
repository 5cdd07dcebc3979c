"""What each unit of a run cost, and what it computed with."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class UnitRow:
    """A unit: how often it was solved, its wall-clock time in s with its share of the run, and its implementation."""

    name: str
    solves: str
    wall_s: str
    share: str
    implementation: str


def unit_table(summary: Mapping[str, Any]) -> list[UnitRow]:
    """A row for each unit, one for the master and one for the whole; empty where the run says nothing of it."""
    wall = summary.get("wall_s")
    if not isinstance(wall, dict) or not isinstance(wall.get("units"), dict):
        return []
    total = float(wall.get("total") or 0.0)
    solves, implementation = summary.get("solves") or {}, summary.get("implementation") or {}

    def row(name: str, seconds: float, count: str, text: str) -> UnitRow:
        share = f"{100.0 * seconds / total:.0f} %" if total else "–"
        return UnitRow(name, count, f"{seconds:.2f}", share, text)

    rows = [
        row(name, float(seconds), str(solves.get(name, "–")), str(implementation.get(name, "–")))
        for name, seconds in wall["units"].items()
    ]
    if "master" in wall:
        rows.append(row("coupling and output (master)", float(wall["master"]), "–", "–"))
    if "setup" in wall:
        rows.append(UnitRow("setting up, before the run", "–", f"{float(wall['setup']):.2f}", "–", "–"))
    return [*rows, row("whole run", total, "–", "–")]
