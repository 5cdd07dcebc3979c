"""The numbers that a run is asked for, with their errors where these were estimated."""

import csv
from dataclasses import dataclass
from math import nan
from pathlib import Path

from ...orchestrator.results.comparison import headlines
from ...orchestrator.results.names import BUDGET_CSV
from ...orchestrator.results.stored_run import StoredRun
from ...studies.budget.budget import Contribution, Quantity
from ...studies.budget.sentences import measured, sentence


@dataclass(frozen=True)
class Headline:
    """A number for a person: its name, value with unit and, where known, error; and where that comes from."""

    name: str
    value: str
    source: str = ""


def headline_table(run: StoredRun) -> list[Headline]:
    """All headline numbers of a run; probes that were not activated say so."""
    contributions = _contributions(run.folder / BUDGET_CSV)
    found = []
    for name, value in headlines(run).items():
        own = contributions.get(name, [])
        quantity = Quantity(name, value, own)
        if own:
            text = measured(quantity)
            source = sentence(quantity).removeprefix(f"{quantity.spoken}: {text}").lstrip(",; ")
            found.append(Headline(quantity.spoken, text, source))
        else:
            found.append(Headline(quantity.spoken, f"{value:.4g} {quantity.unit}".rstrip()))
    times = run.summary.get("activation_time_ms")
    if isinstance(times, dict):
        found += [Headline(f"activation at {probe}", "not activated") for probe, time in times.items() if time is None]
    return found


def _contributions(path: Path) -> dict[str, list[Contribution]]:
    """The error budget beside a run, by quantity; empty where there is none, or not one that we wrote."""
    if not path.exists():
        return {}
    try:
        return _read(path)
    except (KeyError, ValueError):
        return {}


def _read(path: Path) -> dict[str, list[Contribution]]:
    found: dict[str, list[Contribution]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            contribution = Contribution(
                source=row["source"],
                quantity=row["quantity"],
                value=float(row["value"]),
                estimate=float(row["estimate"]) if row["estimate"] else nan,
                order=float(row["order"]) if row["order"] else None,
                trusted=row["trusted"] == "1",
                reason=row["reason"],
                finer=row["finer"],
            )
            found.setdefault(row["quantity"], []).append(contribution)
    return found
