"""Pressure over volume: what a filled or beating cavity does work by."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from ...studies.pictures.colors import COLORS

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
            curves[cavity.upper().replace("_", " ")] = volumes[known], pressures[known]
    if not curves:
        return None
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    axis = figure.subplots()
    for number, (cavity, (volumes, pressures)) in enumerate(curves.items()):
        color = COLORS[number % len(COLORS)]
        axis.plot(volumes, pressures, color=color, linewidth=2.0, label=cavity)
        axis.plot(volumes[0], pressures[0], "o", color=color)
    axis.set_xlabel("cavity volume (ml)", fontsize=12)
    axis.set_ylabel("cavity pressure (kPa)", fontsize=12)
    axis.tick_params(labelsize=11)
    axis.grid(color="0.9")
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(title="cavity", fontsize=11, title_fontsize=11, frameon=False, loc="upper left")
    return figure
