"""What the time series records beside what has figures of its own: uplift, mean stress, outputs of any FMU."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.comparison import spoken, unit_of
from ...orchestrator.results.stored_run import StoredRun
from .plot_axes import curve, key, label, panels, span

#: Endings of columns that other figures show.
_ELSEWHERE = ("_volume_ml", "_strain", "twist_deg")

#: Panels, and curves in each, that can be told apart.
_MOST_PANELS, _MOST_CURVES = 5, 7


def other_outputs(run: StoredRun) -> Figure | None:
    """A panel per unit of measure with a curve per column that changes; None where there is none."""
    time = run.columns.get("time_ms")
    groups: dict[str, dict[str, Values]] = {}
    for name, values in run.columns.items():
        known = values[np.isfinite(values)]
        if name != "time_ms" and len(known) and np.ptp(known) > 0.0 and not _is_shown(name):
            groups.setdefault(unit_of(name), {})[name] = values
    shown = dict(list(groups.items())[:_MOST_PANELS])
    if time is None or not shown:
        return None
    figure, axes = panels(len(shown), 2.8)
    for axis, (unit, columns) in zip(axes, shown.items(), strict=True):
        for number, (name, values) in enumerate(list(columns.items())[:_MOST_CURVES]):
            curve(axis, number, time, values, spoken(name))
        left = len(columns) - _MOST_CURVES
        label(axis, vertical=f"({unit})" if unit else "value (1)")
        if len(columns) == 1:
            label(axis, vertical=f"{spoken(next(iter(columns)))} ({unit or '1'})")
        else:
            key(axis)
            axis.set_title(f"{left} more columns are in timeseries.csv" if left > 0 else "", fontsize=10, loc="right")
    span(axes[-1], time)
    label(axes[-1], "time (ms)")
    return figure


def _is_shown(column: str) -> bool:
    return column.endswith(_ELSEWHERE) or (column.startswith("potential_") and column.endswith("_mV"))
