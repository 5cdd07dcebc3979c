"""The transmembrane potential, on the tissue as it is deformed then, in frames of a beat or at times asked for."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from .frames import at_times, of_a_beat
from .plane import plane_snapshots, sheet_of
from .snapshots import FieldOfFrames, solid_snapshots

_NAME = "potential_mV"


def potential_snapshots(run: StoredRun, times_ms: Sequence[float] = ()) -> Figure | None:
    """A panel per frame, all in the same view and scale: of a solid, or of a sheet of triangles.

    `times_ms` are the times asked for, without which the frames are chosen by what happens. None for a run without a
    frame, without a potential at the nodes, or in another scene.

    Raises
    ------
    InputError
        For a time outside the run.
    """
    mesh, sheet, points = run.mesh, sheet_of(run), run.points_mm
    first = run.frame(_NAME, 0)
    if points is None or first is None or first.shape != (len(points),) or (mesh is None and sheet is None):
        return None
    frames = at_times(run, times_ms) if times_ms else of_a_beat(run, _NAME, "displacement_mm")
    values = [np.asarray(run.frame(_NAME, frame.number)) for frame in frames]
    shown = FieldOfFrames(frames, values, "transmembrane potential (mV)", "plasma", round_to=5.0)
    if mesh is not None:
        return solid_snapshots(run, mesh, shown)
    return None if sheet is None else plane_snapshots(sheet, shown)
