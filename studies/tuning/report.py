"""The result of a search in words."""

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
        f"{name} {row.errors[name]:.3g} {units.get(name, '')}".rstrip() + f" (tolerance {limit:g})"
        if name in row.errors
        else f"{name} unknown"
        for name, limit in tuning.limits.items()
    )


def compared_costs(tuning: Tuning, place: int) -> str:
    """The cost of a point, and that of the scenario as it is."""
    clock = "s" if tuning.cost == WALL else "CPU seconds"
    cost, own = tuning.rows[place].cost(tuning.cost), tuning.own.cost(tuning.cost)
    return f"{cost:.3g} {clock}; the scenario as it is takes {own:.3g} {clock}, {own / cost:.2g} times as much"


def summary(tuning: Tuning) -> str:
    """For a terminal: the cheapest setting, its errors, and what it saves."""
    if tuning.best is None:
        return _nothing(tuning)
    row, option = tuning.rows[tuning.best], tuning.options[tuning.best]
    lines = [
        f"{tuning.task.scenario.name}: {option.line}, {told(option.shown)}",
        f"  keeps {kept(tuning)}; its errors: {errors_told(tuning, row)}",
        f"  takes {compared_costs(tuning, tuning.best)}",
        f"  errors of the scenario as it is: {errors_told(tuning, tuning.own)}",
        *([_longer(tuning, tuning.longer)] if tuning.longer is not None else []),
        f"  {_count(tuning)}",
    ]
    return "\n".join(lines)


def _longer(tuning: Tuning, row: Row) -> str:
    own, cost = tuning.own.cost(tuning.cost), row.cost(tuning.cost)
    return (
        f"  with output.every_ms={row.settings['output.every_ms']:g} and steps of the same length it would take "
        f"{cost:.3g} s, with the errors {errors_told(tuning, row)}; the scenario as it is takes {own / cost:.2g} times "
        "as much; the tuned scenario keeps your output interval"
    )


def _count(tuning: Tuning) -> str:
    run = sum(row.trial is not None for row in tuning.rows)
    return f"{run} of {len(tuning.rows)} settings were run; {len(tuning.rows) - run} were left out (tune.csv says why)"


def _nothing(tuning: Tuning) -> str:
    begin = f"{tuning.task.file}: none of {len(tuning.rows)} settings keeps {kept(tuning)}"
    if tuning.nearest is None:
        return f"{begin}: no run of a setting was completed; see tune.csv for the reasons"
    row, option = tuning.rows[tuning.nearest], tuning.options[tuning.nearest]
    worst = row.worst(tuning.limits)
    nearest = f"; the nearest is {option.line}, {told(option.shown)}, with the errors {errors_told(tuning, row)}"
    tries = f"allow errors {worst:.2g} times as large, or give finer settings in a study (--study)"
    unsure = [
        name for name, value in tuning.chart.uncertainty.items() if isfinite(value) and value > tuning.limits[name]
    ]
    if unsure:
        tries = f"the uncertainty of the reference itself exceeds the tolerance in {', '.join(unsure)}, so {tries}"
    return f"{begin}{nearest}: {tries}"
