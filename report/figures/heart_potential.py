"""The transmembrane potential on the deformed body at chosen times."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .scene import Painted, View, add_scale_bar, pen, shaded, show
from .surface import normals, sharp_edges, smoothing, surface

#: Times of interest of a heartbeat; the nearest stored frames are drawn.
TIMES_MS = (5.0, 35.0, 55.0, 100.0, 145.0, 200.0, 250.0, 300.0)

# From the front and so far above that one looks into the cavities.
_VIEW = View(-78.0, 38.0)
_COLUMNS = 4

# Inches on the page: all panels of a full row, and the colour bar with its label.
_WIDTH, _BAR_WIDTH = 8.8, 1.2

_ROUND_MV = 5.0


def chosen_frames(frames_ms: Values, end_ms: float) -> list[int]:
    """The frames nearest to TIMES_MS as far as the run went, each once; the last frame if it ended before the first."""
    wanted = [time for time in TIMES_MS if time <= end_ms]
    nearest = {int(np.abs(frames_ms - time).argmin()) for time in wanted}
    return sorted(nearest) or [len(frames_ms) - 1]


def heart_potential(run: StoredRun) -> Figure | None:
    """A panel per time, all in the same view and scale; without displacements on the undeformed body.

    None for a run without a frame or without a potential at the nodes.
    """
    mesh, first = run.mesh, run.frame("potential_mV", 0)
    if mesh is None or first is None or first.shape != (mesh.nodes,):
        return None
    frames = chosen_frames(run.frames_ms, run.end_ms)
    potential = [np.asarray(run.frame("potential_mV", frame)) for frame in frames]
    moved = [run.frame("displacement_mm", frame) for frame in frames]
    places = [mesh.points if shift is None else mesh.points + shift for shift in moved]
    deforms = any(shift is not None and shift.any() for shift in moved)

    low, high = np.floor(np.min(potential) / _ROUND_MV), np.ceil(np.max(potential) / _ROUND_MV)
    # A body at rest has one potential; the colour bar still needs two ends.
    colors = ScalarMappable(Normalize(_ROUND_MV * low, _ROUND_MV * max(high, low + 1.0)), "plasma")
    middle, half = _VIEW.extent(np.concatenate([mesh.points, *places]))
    faces, _ = surface(mesh.cells)
    # What is smooth is decided on the undeformed body: wrinkles that come with motion are no edges.
    smooth, edges = smoothing(mesh.points, faces), sharp_edges(mesh.points, faces)

    ghost = [[Painted(mesh.points[faces], np.full((len(faces), 3), 0.88))]] if deforms else []

    columns = min(len(frames), _COLUMNS)
    rows = -(-len(frames) // columns)
    panel = _WIDTH / max(columns, 2)
    figure = Figure(
        figsize=(panel * columns + _BAR_WIDTH, (panel + 0.2) * rows + 0.4), layout=ConstrainedLayoutEngine(h_pad=0.08)
    )
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(frames) :]:
        axis.set_axis_off()
    for axis, frame, points, values in zip(axes, frames, places, potential, strict=False):
        corner_normals = (smooth @ normals(points, faces)).reshape(-1, 3, 3)
        body = shaded(_VIEW, points[faces], values[faces], corner_normals, colors)
        show(axis, _VIEW, [*ghost, [body, pen(_VIEW, points[edges], 2.0 * half)]], middle, half)
        axis.set_title(f"{run.frames_ms[frame]:g} ms", fontsize=11)
    add_scale_bar(axes[0], _VIEW, middle, half)
    bar = figure.colorbar(colors, ax=axes, shrink=0.75, aspect=28, pad=0.015)
    bar.set_label("transmembrane potential (mV)")
    if deforms:
        figure.supxlabel("grey: the undeformed shape", fontsize=10, color="0.35")
    return figure
