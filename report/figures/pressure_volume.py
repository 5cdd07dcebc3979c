"""Pressure over volume: what a filled or beating cavity does work by."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from .cavity_volumes import chamber
from .plot_axes import color, curve, key, label, panels

_VOLUME, _PRESSURE = "_volume_ml", "_pressure_kPa"


def pressure_volume(run: StoredRun) -> Figure | None:
    """A curve per cavity, its beginning marked; None for a run that records no changing pressure beside a volume."""
    curves = {}
    for name, volumes in run.columns.items():
        cavity = name.removesuffix(_VOLUME)
        pressures = run.columns.get(f"{cavity}{_PRESSURE}")
        if not name.endswith(_VOLUME) or pressures is None:
            continue
        known = np.isfinite(volumes) & np.isfinite(pressures)
        if known.any() and np.ptp(pressures[known]) > 0.0 and (volumes[known] > 0.0).all():
            curves[cavity] = volumes[known], pressures[known]
    if not curves:
        return None
    figure, (axis,) = panels(1, 4.2)
    for number, (cavity, (volumes, pressures)) in enumerate(curves.items()):
        curve(axis, number, volumes, pressures, f"{chamber(cavity)}; the dot is the beginning")
        axis.plot(volumes[0], pressures[0], "o", color=color(number))
    label(axis, "cavity volume (ml)", "cavity pressure (kPa)")
    key(axis, 1)
    return figure
