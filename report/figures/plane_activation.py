"""When the wave reached each place of a sheet, and how fast it was along the fibres and across them."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .conduction_speed import conduction_speeds
from .isochrones import NOT_ACTIVATED, Isochrones
from .layout import BAR_IN, TEXT_PT, color_bar, panels
from .plane import frame_plane
from .probes import RIM, mark, probes

# Height of the panel over its width, which leaves room for the labels.
_ASPECT = 0.72


def plane_activation(run: StoredRun, triangles: Triangulation, times_ms: Values, bands: Isochrones) -> Figure:
    """Isochrones as labelled lines over bands of colour, the probes, and both speeds where they can be measured."""
    colors = bands.colors
    # A triangle with a corner that was not activated has no times.
    triangles.set_mask(np.isnan(times_ms)[triangles.triangles].any(axis=1))
    missing = bool(np.isnan(times_ms).any())
    shown = panels(1, 1, _ASPECT, below_in=BAR_IN + 0.25 * missing, title_lines=2)
    (axis,) = shown.axes
    axis.set_facecolor(NOT_ACTIVATED)
    filled = np.where(np.isnan(times_ms), 0.0, times_ms)
    axis.tricontourf(triangles, filled, bands.levels_ms, cmap=colors.cmap, norm=colors.norm)
    lines = axis.tricontour(triangles, filled, bands.inner, colors="black", linewidths=1.0)
    for label in axis.clabel(lines, fmt="%g", fontsize=TEXT_PT):
        label.set_path_effects([RIM])
    frame_plane(axis, triangles)
    mark(axis, {name: (place[0], place[1]) for name, place in probes(run).items()})
    axis.set_title(_speeds(run, times_ms), fontsize=TEXT_PT)
    color_bar(shown, colors, "activation time (ms)", ticks=bands.ticks)
    if missing:
        shown.figure.supxlabel(f"grey: not activated by {run.end_ms:g} ms", fontsize=TEXT_PT)
    return shown.figure


def _speeds(run: StoredRun, times_ms: Values) -> str:
    points, cells, fiber = run.points_mm, run.cells, run.initial("fiber")
    if points is None or cells is None or fiber is None or fiber.shape != (len(cells), 3):
        return ""
    speeds = conduction_speeds(points, cells, fiber, times_ms)
    if speeds is None:
        return ""
    along, across = speeds
    return (
        f"speed along the fibres {along:.2f} m/s, across them {across:.2f} m/s\n"
        "(fitted to the activation times away from stimulus and edges)"
    )
