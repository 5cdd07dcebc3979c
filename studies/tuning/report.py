"""What a search has found, in words."""

from math import isfinite

from ..chart import Row
from ..chart.chart import WALL
from ..point import told
from .result import Tuning


def kept(tuning: Tuning) -> str:
    """The tolerances: `lv_volume_ml within 0.2 ml and activation_ms within 1 ms`."""
    units = {measure.name: measure.unit for measure in tuning.chart.measures}
    parts = [f"{name} within {limit:g} {units.get(name, '')}".rstrip() for name, limit in tuning.limits.items()]
    return " and ".join(parts)


def errors_told(tuning: Tuning, row: Row) -> str:
    """The errors of a point, each with its tolerance."""
    units = {measure.name: measure.unit for measure in tuning.chart.measures}
    return ", ".join(
        f"{name} {row.errors[name]:.3g} {units.get(name, '')}".rstrip() + f" of {limit:g}"
        if name in row.errors
        else f"{name} unknown"
        for name, limit in tuning.limits.items()
    )


def compared_costs(tuning: Tuning, place: int) -> str:
    """What a point costs, and what the scenario as it is."""
    clock = "s" if tuning.cost == WALL else "s of processor time"
    cost, own = tuning.rows[place].cost(tuning.cost), tuning.own.cost(tuning.cost)
    return f"{cost:.3g} {clock} against {own:.3g} {clock} of the scenario as it is, {own / cost:.2g} times cheaper"


def summary(tuning: Tuning) -> str:
    """For a terminal: what won, its settings, its errors, and what it saves."""
    if tuning.best is None:
        return _nothing(tuning)
    row, option = tuning.rows[tuning.best], tuning.options[tuning.best]
    lines = [
        f"{tuning.task.scenario.name}: {option.line}, {told(option.shown)}",
        f"  keeps {kept(tuning)}: {errors_told(tuning, row)}",
        f"  costs {compared_costs(tuning, tuning.best)} ({errors_told(tuning, tuning.own)})",
        *([_longer(tuning, tuning.longer)] if tuning.longer is not None else []),
        f"  {_count(tuning)}",
    ]
    return "\n".join(lines)


def _longer(tuning: Tuning, row: Row) -> str:
    own, cost = tuning.own.cost(tuning.cost), row.cost(tuning.cost)
    return (
        f"  with output.every_ms={row.settings['output.every_ms']:g} and steps as long it would cost {cost:.3g} s, "
        f"{own / cost:.2g} times less than the scenario as it is ({errors_told(tuning, row)}); the tuned scenario "
        "keeps the output interval"
    )


def _count(tuning: Tuning) -> str:
    run = sum(row.trial is not None for row in tuning.rows)
    return f"{run} of {len(tuning.rows)} settings were run, {len(tuning.rows) - run} could not win"


def _nothing(tuning: Tuning) -> str:
    begin = f"{tuning.task.file}: none of {len(tuning.rows)} settings keeps {kept(tuning)}"
    if tuning.nearest is None:
        return f"{begin}: none that was run came to its end, see tune.csv for the reasons"
    row, option = tuning.rows[tuning.nearest], tuning.options[tuning.nearest]
    worst = row.worst(tuning.limits)
    nearest = f"; nearest comes {option.line}, {told(option.shown)}, with {errors_told(tuning, row)}"
    tries = f"allow {worst:.2g} times as much, or give finer settings in a study (--study)"
    unsure = [
        name for name, value in tuning.chart.uncertainty.items() if isfinite(value) and value > tuning.limits[name]
    ]
    if unsure:
        tries = f"the reference itself errs by more than the tolerance in {', '.join(unsure)}, so {tries}"
    return f"{begin}{nearest}: {tries}"
