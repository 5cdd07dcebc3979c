"""A field of the nodes on a sheet of triangles, in several frames."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from ...orchestrator.results.stored_run import StoredRun
from .layout import BAR_IN, COLUMNS, TEXT_PT, color_bar, panels
from .snapshots import FieldOfFrames

# Labels and ticks at the side take so much of the width of all panels that their height is this part of it.
_NARROWER = 0.85


def sheet_of(run: StoredRun) -> Triangulation | None:
    """The triangles of a sheet in the X-Y plane; None in another scene."""
    points, cells = run.points_mm, run.cells
    if points is None or cells is None or cells.shape[1] != 3 or np.ptp(points[:, 2]) > 0.0:
        return None
    return Triangulation(points[:, 0], points[:, 1], cells)


def plane_snapshots(triangles: Triangulation, shown: FieldOfFrames) -> Figure:
    """A panel per frame, all with the same axes."""
    colors = shown.colors
    aspect = np.ptp(triangles.y) / np.ptp(triangles.x)
    lines = max(title.count("\n") + 1 for title in shown.titles)
    array = panels(
        len(shown.frames), COLUMNS, _NARROWER * float(aspect), title_lines=lines, below_in=BAR_IN + 0.4, square=True
    )
    for axis, title, values in zip(array.axes, shown.titles, shown.values, strict=True):
        axis.tripcolor(triangles, values, shading="gouraud", norm=colors.norm, cmap=colors.cmap)
        axis.set_title(title, fontsize=TEXT_PT)
        frame_plane(axis, triangles)
        axis.label_outer()
    color_bar(array, colors, shown.label)
    return array.figure


def frame_plane(axis: Axes, triangles: Triangulation) -> None:
    """Axes around a sheet, with the same scale in both directions and few ticks."""
    axis.set(xlim=(triangles.x.min(), triangles.x.max()), ylim=(triangles.y.min(), triangles.y.max()), aspect="equal")
    axis.set_xlabel("X (mm)", fontsize=TEXT_PT)
    axis.set_ylabel("Y (mm)", fontsize=TEXT_PT)
    axis.locator_params(nbins=4)
    axis.tick_params(labelsize=TEXT_PT)
