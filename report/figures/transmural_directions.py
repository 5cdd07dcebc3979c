"""The coordinate system within the wall from which the fibres are turned: through it, along it, around it."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body, StoredRun
from .layout import LEGEND_IN, TEXT_PT, TITLE_PT, panels
from .scene import View, add_scale_bar, show
from .skin import Skin, evenly
from .surface import section
from .thinning import thinned
from .viewpoints import short_axis, through_wall

# The skin and the face of the cut.
_COLORS = evenly((0.93, 0.93, 0.93), (0.84, 0.84, 0.84))

# Name and colour of an arrow; on a copy without colours, the darker is the one through the wall.
_THROUGH, _ALONG, _AROUND = (
    ("transmural (sheet)", "#8B0000"),
    ("apico-basal", "#3B8ED0"),
    ("circumferential", "#E09A2B"),
)

# Least distance and length of the arrows relative to the size of the body.
_SPACING, _LENGTH = 1 / 14, 1 / 15

# Sine of the angle to the vertical below which no direction along the wall points towards the base.
_VERTICAL = 1e-3

# Arrows that stand nearly upright on the picture are left out: they would be dots.
_SHORT = 0.35


def transmural_directions(run: StoredRun) -> Figure | None:
    """Arrows on a long-axis and on a short-axis section; None for a run without sheet directions per element."""
    mesh, sheet = run.mesh, run.initial("sheet")
    if mesh is None or sheet is None or sheet.shape != (mesh.elements, 3):
        return None
    skin = Skin(mesh)
    along, around = within_wall(sheet)
    lengthwise, across = through_wall(mesh.points, sheet), short_axis(mesh.points)
    scenes = (
        ("long-axis section", lengthwise, ((sheet, _THROUGH), (along, _ALONG))),
        ("short-axis section, from above", across, ((sheet, _THROUGH), (around, _AROUND))),
    )
    windows = [skin.window(view) for _, view, _ in scenes]
    windows = [window.as_large_as(windows).with_margin(_LENGTH * skin.size_mm) for window in windows]
    shown = panels(2, 2, windows[0].aspect, below_in=LEGEND_IN)
    for axis, (title, view, arrows), window in zip(shown.axes, scenes, windows, strict=True):
        skinned = skin.painted(view, np.zeros(mesh.nodes), _COLORS)
        show(axis, view, [[skinned, skin.edges(view)], *skin.cut(view, np.ones(mesh.elements), _COLORS)], window)
        axis.set_title(title, fontsize=TITLE_PT)
        for directions, (_, color) in arrows:
            _draw(axis, view, mesh, directions, color, skin.size_mm)
    add_scale_bar(shown.axes[0], lengthwise, windows[0])
    handles = [
        Line2D([], [], color=color, marker=">", linewidth=2.0, label=name)
        for name, color in (_THROUGH, _ALONG, _AROUND)
    ]
    shown.figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=TEXT_PT, frameon=False)
    return shown.figure


def within_wall(sheet: Values) -> tuple[Values, Values]:
    """Directions along the wall towards the base and around it, shape (n, 3), from unit vectors through the wall.

    The Z axis made normal to the sheet direction, and the product of both (model.md, Fibre generator); zero where the
    wall is horizontal.
    """
    along = np.array([0.0, 0.0, 1.0]) - sheet[:, 2:] * sheet
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > _VERTICAL, along / np.maximum(length, _VERTICAL), 0.0)
    return along, np.cross(sheet, along)


def _draw(axis: Axes, view: View, mesh: Body, directions: Values, color: str, size_mm: float) -> None:
    """Arrows from places on the cut that lie far enough apart."""
    triangles, element = section(mesh.points, mesh.cells, view.beyond(mesh.points))
    middles = triangles.mean(axis=1)
    chosen = thinned(middles, _SPACING * size_mm)
    flat = directions[element[chosen]] @ view.axes[:2].T
    seen = np.linalg.norm(flat, axis=1) > _SHORT
    x, y = (middles[chosen[seen]] @ view.axes[:2].T).T
    u, v = (_LENGTH * size_mm * flat[seen]).T
    arrows = axis.quiver(
        x,
        y,
        u,
        v,
        color=color,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.008,
        headwidth=3.6,
        headlength=4.0,
        headaxislength=3.6,
        zorder=8,
        clip_on=False,
    )
    # Else room would be kept for arrows of any length.
    arrows.set_in_layout(False)
