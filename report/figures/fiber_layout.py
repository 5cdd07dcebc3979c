"""Fibres in the undeformed configuration: at three depths of the wall, and how their helix angle changes through it."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body, StoredRun
from .layout import BAR_IN, TITLE_PT, color_bar, panels
from .scene import Painted, View, add_scale_bar, shaded, show, strokes
from .skin import Skin
from .surface import Numbers
from .thinning import thinned
from .viewpoints import facing, short_axis, through_wall
from .wall_layers import Layer, layers_of_the_wall, surfaces

# Least distance, length and width of the fibre lines relative to the size of the body.
_SPACING, _LENGTH, _WIDTH = 1 / 24, 1 / 15, 1 / 120

# Lines on faces that are seen from the side, by the cosine of the angle, would stick out of the outline like hair.
_FRONT = 0.15

# Dark lines on pale colours: the directions are seen without any colour.
_INK, _WHITE = 0.1, 0.25

# The side of a surface within the wall that is not the outer one.
_INSIDE = 0.9

# From so far to the right of the front, and so far above, the sections are looked at, in degrees.
_LENGTHWISE, _ACROSS = (0.0, 22.0), 50.0


def fiber_layout(run: StoredRun) -> Figure | None:
    """Fibres at epicardium, mid-wall and endocardium from one side, and two sections; None without fibres per element.

    Of a run that does not know the surfaces of its wall the skin is shown in place of the three depths.
    """
    mesh, fiber = run.mesh, run.initial("fiber")
    if mesh is None or fiber is None or fiber.shape != (mesh.elements, 3):
        return None
    skin = Skin(mesh)
    sheet = run.initial("sheet")
    outward = sheet if sheet is not None and sheet.shape == fiber.shape else _from_axis(mesh)
    angle = helix_angle(fiber, outward)
    # A few odd elements, at an apex say, must not take the colours from all the others.
    limit = float(np.clip(30.0 * np.ceil(np.percentile(np.abs(angle), 98.0) / 30.0), 30.0, 90.0))
    colors = ScalarMappable(Normalize(-limit, limit), "viridis")

    wall = surfaces(run.boundaries)
    # Nothing but the outer surface says from where a piece of wall is seen from outside.
    outer = mesh.points[skin.faces if wall is None else wall[1]]
    outside = facing(0.5 * np.cross(outer[:, 1] - outer[:, 0], outer[:, 2] - outer[:, 0]))
    layers = {} if wall is None else layers_of_the_wall(skin, outward, angle, *wall)
    right, above = _LENGTHWISE
    cuts = {
        "cut lengthwise": through_wall(mesh.points, outward, right, above),
        "upper part cut away": short_axis(mesh.points, _ACROSS),
    }
    skins = cuts if layers else {"from outside": outside, **cuts}
    views = [*(outside for _ in layers), *skins.values()]
    windows = [skin.window(view) for view in views]
    windows = [window.as_large_as(windows) for window in windows]
    shown = panels(len(views), 3, windows[0].aspect, below_in=BAR_IN)
    for axis, title, view, window in zip(shown.axes, [*layers, *skins], views, windows, strict=True):
        if title in layers:
            layer = layers[title]
            drawn = [[_inside(view, layer), *_painted(view, layer, colors, skin.size_mm)]]
        else:
            layer = Layer(mesh.points[skin.faces], skin.spread(angle), skin.corner_normals(), fiber[skin.element])
            body = [*_painted(view, layer, colors, skin.size_mm), skin.edges(view)]
            drawn = [body, *skin.cut(view, angle, colors)]
        show(axis, view, drawn, window)
        axis.set_title(title, fontsize=TITLE_PT)
    add_scale_bar(shown.axes[0], views[0], windows[0])
    ticks = [tick for tick in range(-90, 91, 30) if abs(tick) <= limit]
    extend = "both" if np.abs(angle).max() > limit else "neither"
    color_bar(shown, colors, "helix angle to the horizontal plane (°)", ticks=ticks, extend=extend)
    return shown.figure


def helix_angle(fiber: Values, outward: Values) -> Values:
    """Angle in degrees from −90 to 90 between fibres and the horizontal plane, measured within the wall.

    Positive where the fibre rises on its way around the wall, counterclockwise as seen from above; which of its two
    ends a fibre vector points to makes no difference. Where the wall is horizontal, so is every direction in it: 0.

    Parameters
    ----------
    fiber:
        Directions, shape (n, 3).
    outward:
        Unit vectors through the wall, from inside to outside, shape (n, 3).
    """
    upward = np.array([0.0, 0.0, 1.0]) - outward[:, 2:] * outward
    around = np.cross(upward, outward)
    rise, run = np.einsum("ni,ni->n", fiber, upward), np.einsum("ni,ni->n", fiber, around)
    degenerate = np.hypot(rise, run) < 1e-9
    angle = np.degrees(np.arctan2(np.where(run < 0.0, -rise, rise), np.abs(run)))
    return np.asarray(np.where(degenerate, 0.0, angle))


def fiber_lines(corners: Values, directions: Values, spacing_mm: float, length_mm: float) -> tuple[Values, Numbers]:
    """Short straight lines on a surface along `directions`, the same ones on every call.

    Parameters
    ----------
    corners:
        Of the faces, in mm, shape (faces, 3, 3).
    directions:
        One per face, shape (faces, 3). They need not lie in the faces: their part within counts.
    spacing_mm, length_mm:
        Least distance between the middles of two lines, which are centres of faces, and how long a line is.

    Returns
    -------
    Ends of the lines in mm, shape (lines, 2, 3), and the face of each.
    """
    centres = corners.mean(axis=1)
    face = thinned(centres, spacing_mm)
    across = np.cross(corners[face, 1] - corners[face, 0], corners[face, 2] - corners[face, 0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    along = directions[face] - np.einsum("ni,ni->n", directions[face], across)[:, None] * across
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    return centres[face, None] + 0.5 * length_mm * np.array([[-1.0], [1.0]]) * along[:, None], face


def _from_axis(mesh: Body) -> Values:
    """Horizontal directions away from the vertical axis through the body: outward, where no sheets say it better."""
    away = mesh.centroids - np.average(mesh.centroids, axis=0, weights=mesh.volumes)
    away[:, 2] = 0.0
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12))


def _painted(view: View, layer: Layer, colors: ScalarMappable, size_mm: float) -> list[Painted]:
    """The surface in pale colours, and on it lines along the fibres."""
    lines, face = fiber_lines(layer.corners, layer.fiber, _SPACING * size_mm, _LENGTH * size_mm)
    lines = lines[layer.face_normals[face] @ view.axes[2] > _FRONT]
    surface = shaded(view, layer.corners, layer.angle, layer.normals, colors, white=_WHITE)
    return [surface, strokes(view, lines, np.full((len(lines), 3), _INK), _WIDTH * size_mm, size_mm / 60)]


def _inside(view: View, layer: Layer) -> Painted:
    """The side of a surface within the wall that looks away: without it what is far off would float in the air."""
    away = layer.corners[layer.face_normals @ view.axes[2] <= 0.0]
    return Painted(away, np.full((len(away), 3), _INSIDE))
