"""A single cell: its action potential, the active stress that follows it, and the stretch of its fibre."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from .plot_axes import WIDTH, curve, label, styled

#: The fields of a cell in the order of cause and effect, and how their axes are labelled.
_FIELDS = {
    "potential_mV": "transmembrane\npotential (mV)",
    "active_stress_kPa": "active stress (kPa)",
    "stretch": "fibre stretch (–)",
}


#: How much of the beginning is shown larger: the upstroke, and how the others follow it.
_UPSTROKE_MS = 20.0


def cell_response(run: StoredRun) -> Figure | None:
    """All of the run and its upstroke, from the stored frames; None for scenes of more than one place."""
    points = run.points_mm
    if points is None or np.ptp(points, axis=0).any() or len(run.frames_ms) < 2:
        return None
    found = {text: name for name, text in _FIELDS.items() if name in run.moving}
    if not found:
        return None
    figure = Figure(figsize=(WIDTH, 2.1 * len(found) + 0.5), layout="constrained")
    axes = figure.subplots(len(found), 2, sharex="col", sharey="row", squeeze=False)
    for row, (text, name) in zip(axes, found.items(), strict=True):
        frames = [np.asarray(run.frame(name, frame)).ravel()[0] for frame in range(len(run.frames_ms))]
        for axis in row:
            styled(axis)
            curve(axis, 0, run.frames_ms, np.array(frames))
        label(row[0], vertical=text)
    begin, end = run.frames_ms[0], run.frames_ms[-1]
    for axis, until, text in zip(axes[-1], (end, min(begin + _UPSTROKE_MS, end)), ("", ", the upstroke"), strict=True):
        axis.set_xlim(begin, until)
        label(axis, f"time (ms){text}")
    return figure
