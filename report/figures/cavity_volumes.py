"""The volumes of the cavities over time, with end-systole and the ejection fraction."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from .plot_axes import color, curve, key, label, panels, span

_VOLUME = "_volume_ml"

#: How the chambers of the heart are called.
_CHAMBERS = {"lv": "left ventricle", "rv": "right ventricle"}


def chamber(name: str) -> str:
    """A chamber as a person calls it, from the beginning of its columns."""
    return _CHAMBERS.get(name, name.replace("_", " "))


def cavity_volumes(run: StoredRun) -> Figure | None:
    """A curve per cavity, from zero, so that heights compare as volumes; None for a run that records no volume.

    End-systole, the smallest volume, is marked where the cavity ejects.
    """
    time = run.columns.get("time_ms")
    # A scene without that cavity has no volume of it.
    found = {name: values for name, values in run.columns.items() if name.endswith(_VOLUME) and np.any(values > 0.0)}
    if time is None or not len(time) or not found:
        return None
    fractions = run.summary.get("ejection_fraction") or {}
    figure, (axis,) = panels(1, 4.2)
    for number, (column, values) in enumerate(found.items()):
        cavity = column.removesuffix(_VOLUME)
        smallest = int(np.nanargmin(values))
        ejects = fractions.get(cavity, 0.0) > 0.0 and values[smallest] < values[0]
        told = (
            f": {values[smallest]:.1f} ml at end-systole, ejection fraction {fractions[cavity]:.2f}" if ejects else ""
        )
        curve(axis, number, time, values, f"{chamber(cavity)}{told}")
        if ejects:
            axis.plot(time[smallest], values[smallest], "v", color=color(number), markeredgecolor="black", zorder=5)
            axis.annotate(
                f"end-systole, {time[smallest]:g} ms",
                (time[smallest], values[smallest]),
                xytext=(0, -8),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=10,
            )
    axis.set_ylim(bottom=0.0)
    span(axis, time)
    label(axis, "time (ms)", "cavity volume (ml)")
    key(axis, 1)
    return figure
