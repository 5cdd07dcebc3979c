"""A strand: the potential over place and time, the front of the wave in it, and how fast that is."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .plot_axes import label, note, panels

#: The part of the strand, of its length, over which the speed is measured: away from the stimulus and from the end.
_FROM, _TO = 0.4, 0.9


def space_time(run: StoredRun) -> Figure | None:
    """The potential at every node over time, with the line of activation; None for scenes that are no line."""
    points = run.points_mm
    if points is None or len(points) < 2 or np.ptp(points[:, 1:], axis=0).any():
        return None
    if "potential_mV" not in run.moving or len(run.frames_ms) < 2:
        return None
    order = np.argsort(points[:, 0])
    place = points[order, 0]
    potential = np.array([np.asarray(run.frame("potential_mV", n))[order] for n in range(len(run.frames_ms))])
    figure, (axis,) = panels(1, 4.6)
    colors = axis.pcolormesh(place, run.frames_ms, potential, cmap="viridis", shading="gouraud", rasterized=True)
    figure.colorbar(colors, ax=axis, pad=0.02).set_label("transmembrane potential (mV)", fontsize=11)
    activation = run.frame("activation_time_ms", len(run.frames_ms) - 1)
    if activation is not None and (reached := activation[order] >= 0.0).any():
        axis.plot(place[reached], activation[order][reached], "--", color="white", linewidth=1.6)
        speed = front_speed(place[reached], activation[order][reached])
        told = "" if speed is None else f", {speed:.3f} mm/ms away from the ends"
        note(axis, f"dashed: the front of the wave{told}")
    axis.grid(visible=False)
    label(axis, "place along the fibre (mm)", "time (ms)")
    return figure


def front_speed(place_mm: Values, activation_ms: Values) -> float | None:
    """Speed of a wave in mm/ms from the places that it has reached and when, in order, each of shape (nodes,).

    The slope of a straight line through the part from 40 to 90 % of the way; None where it has not come so far, or
    where all of it is activated at once.
    """
    part = place_mm - place_mm[0]
    within = (part >= _FROM * part[-1]) & (part <= _TO * part[-1])
    if within.sum() < 3 or not np.ptp(activation_ms[within]) > 0.0:
        return None
    slope = float(np.polyfit(activation_ms[within], place_mm[within], 1)[0])
    return abs(slope)
