"""The time series of a run as panels: one for each unit of measure, or quantity where none is named."""

from collections.abc import Sequence

import numpy as np

from ...orchestrator.results.stored_run import StoredRun
from .panels import MOST_CURVES, Curve, Panel
from .wording import split, spoken, with_unit

#: Panels of a page at most.
_MOST_PANELS = 12

#: What panels of several quantities of one unit of measure show, by that unit.
_GROUPS = {"mV": "transmembrane potential", "ml": "cavity volume", "kPa": "stress and pressure", "mm": "length"}


def run_curves(run: StoredRun) -> tuple[list[Panel], list[str]]:
    """The panels, and sentences on what is not drawn: what is constant, and what there is no room for."""
    time = run.columns.get("time_ms")
    if time is None or not len(time):
        return [], []
    constant: list[str] = []
    grouped: dict[tuple[str, str], list[str]] = {}
    for name, values in run.columns.items():
        known = values[np.isfinite(values)]
        if name != "time_ms" and len(known):
            if len(time) > 1 and (known == known[0]).all():
                constant.append(f"{name} = {known[0]:g}")
                continue
            stem, unit = split(name)
            # Without a unit of measure, only what has one name is compared.
            grouped.setdefault((unit, "" if unit else _kind(stem)), []).append(name)
    panels = []
    left_out = sum(len(names) for names in list(grouped.values())[_MOST_PANELS:])
    for (unit, kind), names in list(grouped.items())[:_MOST_PANELS]:
        left_out += len(names[MOST_CURVES:])
        shown = names[:MOST_CURVES]
        what = spoken(names[0]) if len(names) == 1 else _GROUPS.get(unit, kind.replace("_", " ") or "values")
        curves = [Curve(name, time, run.columns[column]) for name, column in zip(_short(shown), shown, strict=True)]
        is_known = bool(unit) or kind.endswith(("strain", "stretch"))
        title = with_unit(what, unit) if is_known else f"{what} (unit of measure not given)"
        panels.append(Panel(title, curves))
    notes = []
    if constant:
        more = "" if len(constant) <= MOST_CURVES else f", and {len(constant) - MOST_CURVES} more columns"
        notes.append(f"Constant throughout the run: {', '.join(constant[:MOST_CURVES])}{more}")
    if left_out:
        notes.append(f"{left_out} more columns are in timeseries.csv")
    return panels, notes


def _kind(stem: str) -> str:
    """What a quantity without a unit of measure is compared with: all strains, or all of its own name."""
    last = stem.rpartition(".")[2]
    return "strain" if last.endswith("strain") else last.partition("[")[0]


def _short(names: Sequence[str]) -> list[str]:
    """The names of the curves of a panel, without the words that all begin and end with."""
    words = [spoken(name).split() for name in names]
    for place in (0, -1):
        while len(names) > 1 and all(len(each) > 1 and each[place] == words[0][place] for each in words):
            for each in words:
                del each[place]
    return [" ".join(each) for each in words]
