"""The transmembrane potential at the probes over time, with the moment at which each place is activated."""

import re

from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.results.summary import ACTIVATION_MV
from .plot_axes import color, curve, key, label, panels, span

_PROBE = re.compile(r"(?:(?P<unit>.+)\.)?potential_(?P<probe>.+)_mV")


def probe_potential(run: StoredRun) -> Figure | None:
    """A curve per probe, its activation marked where it crosses −20 mV; None for a run without probed potentials."""
    found = {name: match for name in run.columns if (match := _PROBE.fullmatch(name))}
    time = run.columns.get("time_ms")
    if time is None or not len(time) or not found:
        return None
    activation = run.summary.get("activation_time_ms") or {}
    figure, (axis,) = panels(1, 4.2)
    for number, (column, match) in enumerate(found.items()):
        unit, probe = match.group("unit", "probe")
        name, begin = (probe, activation.get(probe)) if unit is None else (f"{probe} ({unit})", None)
        told = name if begin is None else f"{name}: activated at {begin:.1f} ms"
        curve(axis, number, time, run.columns[column], told)
        if begin is not None:
            axis.plot(begin, ACTIVATION_MV, "o", color=color(number), markeredgecolor="black", zorder=5)
            axis.axvline(begin, color=color(number), linewidth=0.8, alpha=0.5)
    if any(begin is not None for begin in activation.values()):
        axis.axhline(ACTIVATION_MV, color="0.5", linewidth=0.8)
    span(axis, time)
    label(axis, "time (ms)", "transmembrane potential (mV)")
    key(axis)
    return figure
