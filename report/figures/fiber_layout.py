"""Fibres in the undeformed configuration, coloured by their helix angle."""

import math

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from scipy.spatial import cKDTree

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body, StoredRun
from .scene import Painted, View, add_scale_bar, pen, shaded, show, strokes
from .surface import Numbers, normals, section, sharp_edges, smoothing, surface

# Least distance, length and width of the fibre lines relative to the size of the body.
_SPACING, _LENGTH, _WIDTH = 1 / 36, 1 / 20, 1 / 250

# Lines on faces that are seen from the side, by the cosine of the angle, would stick out of the outline like hair.
_FRONT = 0.15

# Title, azimuth and elevation of the eye, and what is cut off: the direction, and from which part of the extent on.
_SCENES = (
    ("from outside", -70.0, 12.0, (0.0, 0.0, 1.0), math.inf),
    ("front half cut away", -90.0, 22.0, (0.0, -1.0, 0.0), 0.5),
    ("upper third cut away", -90.0, 50.0, (0.0, 0.0, 1.0), 0.67),
)


def fiber_layout(run: StoredRun) -> Figure | None:
    """The body from outside, cut lengthwise and cut across; None for a run without fibres per element."""
    mesh, fiber = run.mesh, run.initial("fiber")
    if mesh is None or fiber is None or fiber.shape != (mesh.elements, 3):
        return None
    sheet = run.initial("sheet")
    angle = helix_angle(fiber, sheet if sheet is not None and sheet.shape == fiber.shape else _from_axis(mesh))
    # A few odd elements, at an apex say, must not take the colours from all the others.
    limit = float(np.clip(30.0 * np.ceil(np.percentile(np.abs(angle), 98.0) / 30.0), 30.0, 90.0))
    colors = ScalarMappable(Normalize(-limit, limit), "coolwarm")

    body = _Painter(mesh, fiber, angle, colors)
    views = []
    for _, azimuth, elevation, away, at in _SCENES:
        along = mesh.points @ np.array(away)
        views.append(View(azimuth, elevation, away, along.min() + at * np.ptp(along)))
    rims = [section(mesh.points, body.faces, view.beyond(mesh.points))[0].reshape(-1, 3) for view in views]
    extents = [view.extent(np.concatenate([mesh.points, rim])) for view, rim in zip(views, rims, strict=True)]
    half = max(half for _, half in extents)
    figure = Figure(figsize=(10.0, 3.4), layout=ConstrainedLayoutEngine(h_pad=0.08))
    axes = figure.subplots(1, len(_SCENES))
    for axis, (title, *_), view, (middle, _) in zip(axes, _SCENES, views, extents, strict=True):
        show(axis, view, [body.painted(view)], middle, half)
        axis.set_title(title, fontsize=11)
    add_scale_bar(axes[0], views[0], extents[0][0], half)
    exceeded = np.abs(angle).max() > limit
    bar = figure.colorbar(colors, ax=axes, shrink=0.75, aspect=28, pad=0.015, extend="both" if exceeded else "neither")
    bar.set_label("helix angle to the horizontal plane (°)")
    bar.set_ticks([tick for tick in range(-90, 91, 30) if abs(tick) <= limit])
    return figure


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
    free = np.ones(len(centres), dtype=bool)
    near = cKDTree(centres).query_ball_point(centres, spacing_mm)
    # In the order of the mesh, the lines would stand in rows.
    for number in np.random.default_rng(0).permutation(len(centres)):
        if free[number]:
            free[near[number]] = False
            free[number] = True
    face = np.flatnonzero(free)
    across = np.cross(corners[face, 1] - corners[face, 0], corners[face, 2] - corners[face, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = directions[face] - np.einsum("ni,ni->n", directions[face], across)[:, None] * across
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    return centres[face, None] + 0.5 * length_mm * np.array([[-1.0], [1.0]]) * along[:, None], face


def _from_axis(mesh: Body) -> Values:
    """Horizontal directions away from the vertical axis through the body: outward, where no sheets say it better."""
    away = mesh.centroids - np.average(mesh.centroids, axis=0, weights=mesh.volumes)
    away[:, 2] = 0.0
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12))


class _Painter:
    """The mesh with all that is the same in every view."""

    def __init__(self, mesh: Body, fiber: Values, angle: Values, colors: ScalarMappable) -> None:
        self._mesh, self._angle, self._colors = mesh, angle, colors
        self._size = float(np.ptp(mesh.points, axis=0).max())
        self.faces, element = surface(mesh.cells)
        self._normals = normals(mesh.points, self.faces)
        self._smooth = smoothing(mesh.points, self.faces)
        self._edges = sharp_edges(mesh.points, self.faces)
        self._on_surface = (self._smooth @ angle[element]).reshape(-1, 3)
        self._lines, self._line_face = fiber_lines(
            mesh.points[self.faces], fiber[element], _SPACING * self._size, _LENGTH * self._size
        )

    def painted(self, view: View) -> list[Painted]:
        """The surface in pale colours, so that the fibres stand out; the cut in full ones, even in each element."""
        points, faces = self._mesh.points, self.faces
        corner_normals = (self._smooth @ self._normals).reshape(-1, 3, 3)
        skin = shaded(view, points[faces], self._on_surface, corner_normals, self._colors, white=0.4)
        front = (self._normals @ view.axes[2])[self._line_face] > _FRONT
        rgb = 0.7 * self._colors.to_rgba(self._on_surface.mean(axis=1)[self._line_face[front]])[:, :3]
        fibers = strokes(view, self._lines[front], rgb, _WIDTH * self._size, self._size / 60)
        height = view.beyond(points)
        rim, _ = section(points, faces, height)
        edges = pen(view, np.concatenate([points[self._edges], rim]), self._size)
        triangles, element = section(points, self._mesh.cells, height)
        return [skin, fibers, edges, Painted(triangles, self._colors.to_rgba(self._angle[element])[:, :3])]
