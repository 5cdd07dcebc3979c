"""The undeformed body and its dimensions."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .layout import TEXT_PT, TITLE_PT, Panels, panels
from .scene import View, Window, add_scale_bar, show
from .skin import Skin, evenly
from .surface import Numbers, section
from .viewpoints import ABOVE, FRONT, TILTED, long_axis

# The skin and the face of the cut.
_COLORS = evenly((0.86, 0.72, 0.68), (0.72, 0.45, 0.42))

# Dimensions stand so far from the body, and the picture reaches so much farther for them, relative to its size.
_AWAY, _ROOM = 0.07, 0.2

# The widths of walls and cavities are measured so little below the top, relative to the height: in the rim itself
# there is nothing to be crossed.
_DEPTH = 0.001


def geometry(run: StoredRun) -> Figure | None:
    """The body from outside, from above its base, and cut lengthwise with its dimensions; None for other scenes."""
    mesh = run.mesh
    if mesh is None:
        return None
    skin = Skin(mesh)
    lengthwise = long_axis(mesh.points)
    scenes = {
        "from the front": FRONT,
        "looking down on the base": TILTED,
        "front half cut away": lengthwise,
        "from above": ABOVE,
    }
    windows = [skin.window(view) for view in scenes.values()]
    room = _ROOM * skin.size_mm
    windows[0] = _with_room(windows[0], FRONT, left=room, above=0.0)
    windows[2] = _with_room(windows[2], lengthwise, left=room, above=room)
    windows[3] = _with_room(windows[3], ABOVE, left=room, above=-room)
    windows = [window.as_large_as(windows) for window in windows]
    shown = panels(4, 2, windows[0].aspect)
    whole = np.zeros(mesh.nodes)
    for axis, (title, view), window in zip(shown.axes, scenes.items(), windows, strict=True):
        cut = skin.cut(view, np.ones(mesh.elements), _COLORS)
        show(axis, view, [[skin.painted(view, whole, _COLORS), skin.edges(view)], *cut], window)
        axis.set_title(title, fontsize=TITLE_PT)
    _axes_of_space(shown.axes[0], FRONT, windows[0], skin.size_mm)
    _lengthwise(shown, lengthwise, skin, run.boundaries)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    away = _AWAY * skin.size_mm
    _dimension(shown.axes[3], (low[0] - away, low[1]), (low[0] - away, high[1]))
    _dimension(shown.axes[3], (low[0], low[1] - away), (high[0], low[1] - away), below=True)
    add_scale_bar(shown.axes[1], TILTED, windows[1])
    volume = f"{mesh.volumes.sum() / 1000.0:.3g} ml of tissue"
    shown.figure.supxlabel(
        f"dimensions in mm; {volume} in {mesh.elements} elements with {mesh.nodes} nodes", fontsize=TEXT_PT
    )
    return shown.figure


def _with_room(window: Window, view: View, left: float, above: float) -> Window:
    """A window with so many mm more on the left, and above or, if negative, below."""
    right, upward, _ = view.axes
    middle = window.middle - 0.5 * left * right + 0.5 * above * upward
    return Window(middle, window.half_width_mm + 0.5 * left, window.half_height_mm + 0.5 * abs(above))


def _lengthwise(shown: Panels, view: View, skin: Skin, boundaries: Mapping[str, Numbers]) -> None:
    """The height of the body beside the cut, above it the widths of walls and cavities just below the top.

    The cavities get their names there and in the picture from above.
    """
    _, _, axis, above = shown.axes
    points = skin.mesh.points
    low, high = points.min(axis=0), points.max(axis=0)
    away = _AWAY * skin.size_mm
    _dimension(axis, (low[0] - away, low[2]), (low[0] - away, high[2]))
    rim, _ = section(points, skin.faces, view.beyond(points))
    level = high[2] - _DEPTH * (high[2] - low[2])
    ends = rim.reshape(-1, 3)
    # The rim where it crosses this height.
    crossings, _ = section(ends[:, :2], np.arange(len(ends)).reshape(-1, 2), ends[:, 2] - level)
    x = np.unique(np.round(crossings[:, 0, 0], 3))
    for number, (begin, end) in enumerate(pairwise(x)):
        _dimension(axis, (begin, high[2] + away), (end, high[2] + away))
        side = _side(points, boundaries, np.array([begin, crossings[0, 0, 1], level]))
        # Walls and cavities alternate.
        if number % 2 == 1 and side:
            _name(axis, 0.5 * (begin + end), high[2] - 0.15 * (high[2] - low[2]), side)
            _name(above, 0.5 * (begin + end), crossings[0, 0, 1], side)


def _side(points: Values, boundaries: Mapping[str, Numbers], place: Values) -> str:
    """Which ventricle's inner surface is nearest to a place: LV or RV; empty if none of the boundaries says so."""
    distances: dict[str, float] = {}
    for name, faces in boundaries.items():
        if name.startswith(("lv_", "rv_")):
            side = name[:2].upper()
            distance = float(np.linalg.norm(points[faces.ravel()] - place, axis=1).min())
            distances[side] = min(distance, distances.get(side, distance))
    return min(distances, key=lambda side: distances[side], default="")


def _dimension(axis: Axes, begin: tuple[float, float], end: tuple[float, float], *, below: bool = False) -> None:
    """A line with two ends and the length beside it: left of a vertical one, above or below a horizontal one."""
    arrow = {"arrowstyle": "|-|,widthA=0.25,widthB=0.25", "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 1.0}
    axis.annotate("", begin, end, arrowprops=arrow, zorder=9)
    (x, y), (other_x, other_y) = begin, end
    upright = x == other_x
    length = float(np.hypot(other_x - x, other_y - y))
    axis.annotate(
        f"{round(length, 0 if length > 10.0 else 1):g}",
        (0.5 * (x + other_x), 0.5 * (y + other_y)),
        (-5, 0) if upright else (0, -4 if below else 4),
        textcoords="offset points",
        ha="right" if upright else "center",
        va="center" if upright else "top" if below else "bottom",
        fontsize=TEXT_PT,
        zorder=9,
    )


def _axes_of_space(axis: Axes, view: View, window: Window, size_mm: float) -> None:
    """The directions of X, Y and Z in the lower left of a picture."""
    right, upward, _ = view.axes
    length = 0.16 * size_mm
    x = window.middle @ right - window.half_width_mm + 0.5 * length
    y = window.middle @ upward - window.half_height_mm + 0.4 * length
    for name, direction in zip("XYZ", np.eye(3), strict=True):
        across, up = float(direction @ right), float(direction @ upward)
        tip = x + length * across, y + length * up
        axis.annotate("", tip, (x, y), arrowprops={"arrowstyle": "->", "shrinkA": 0, "shrinkB": 0}, zorder=9)
        _name(axis, x + 1.35 * length * across, y + 1.35 * length * up, name)


def _name(axis: Axes, x: float, y: float, name: str) -> None:
    axis.text(x, y, name, ha="center", va="center", fontsize=TITLE_PT, zorder=9)
