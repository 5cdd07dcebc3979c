"""How far the tissue has moved, for runs of mechanics alone: what a beat shows on the potential's pictures."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from .frames import at_times, of_a_load
from .snapshots import FieldOfFrames, solid_snapshots

_NAME = "displacement_mm"


def displacement_snapshots(run: StoredRun, times_ms: Sequence[float] = ()) -> Figure | None:
    """A panel per frame; None for a run that has a potential, where nothing moves, or in a scene without a solid.

    Raises
    ------
    InputError
        For a time outside the run.
    """
    mesh = run.mesh
    if mesh is None or run.frame("potential_mV", 0) is not None:
        return None
    frames = of_a_load(run, _NAME)
    if not frames:
        return None
    frames = at_times(run, times_ms) if times_ms else frames
    sizes = [np.linalg.norm(np.asarray(run.frame(_NAME, frame.number)), axis=1) for frame in frames]
    # A body that is filled hides its undeformed shape; the colours say how far it has moved.
    shown = FieldOfFrames(frames, sizes, "displacement (mm)", "viridis", round_to=0.1, undeformed=False)
    return solid_snapshots(run, mesh, shown)
