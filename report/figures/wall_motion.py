"""How the wall of the left ventricle moves over a beat: its twist and its mean strains."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from .plot_axes import curve, key, label, note, panels, span

_TWIST, _STRAIN = "twist_deg", "_strain"


def wall_motion(run: StoredRun) -> Figure | None:
    """Twist above, strains below; None for a run in which neither changes."""
    time = run.columns.get("time_ms")
    strains = {name: values for name, values in run.columns.items() if name.endswith(_STRAIN) and _moves(values)}
    twist = run.columns.get(_TWIST)
    twists = twist is not None and _moves(twist)
    if time is None or not (twists or strains):
        return None
    figure, axes = panels(twists + bool(strains), 2.8)
    if twist is not None and twists:
        largest = int(np.nanargmax(np.abs(twist)))
        curve(axes[0], 0, time, twist)
        note(axes[0], f"left ventricle: largest twist {twist[largest]:.1f}° at {time[largest]:g} ms")
        label(axes[0], vertical="twist (°)")
    if strains:
        for number, (name, values) in enumerate(strains.items()):
            curve(axes[-1], number, time, 100.0 * values, name.removesuffix(_STRAIN))
        label(axes[-1], vertical="mean Green–Lagrange\nstrain (%)")
        key(axes[-1], 3)
    span(axes[-1], time)
    label(axes[-1], "time (ms)")
    return figure


def _moves(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return bool(len(known)) and float(np.ptp(known)) > 0.0
