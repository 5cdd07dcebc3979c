"""Bodies in space on flat axes: shaded triangles and strokes, sorted by depth, in parallel projection.

Triangles are sorted by the depth of their centres and coloured evenly. Faces are therefore cut into small pieces, those
seen from behind are left out, and strokes are thin triangles in the same collection: only so walls hide the strokes
behind them. Matplotlib's 3-D axes would do that too, in five times the time.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import TriMesh
from matplotlib.tri import Triangulation

from ...orchestrator.participants.participant import Values
from .layout import TEXT_PT
from .surface import divided

# Faces are quartered up to so many times: while they are few, where the cut goes through, and where a face has
# different colours, by this part of the colour bar.
_ROUNDS, _FEW, _SHADE = 3, 2_000, 0.04

# Lines are cut into so many pieces.
_PARTS = 4

# Towards the light, as right, up and towards the eye: over the viewer's left shoulder.
_LIGHT = np.array([-0.35, 0.35, 0.87]) / np.linalg.norm([-0.35, 0.35, 0.87])

# Brightness in full shadow; high, because the colour carries the value and must be read everywhere.
_AMBIENT = 0.75

# The axes reach a little farther than what is shown.
_MARGIN = 1.04

# Lengths of the scale bar in mm.
_BARS_MM = tuple(base * 10.0**power for power in range(-2, 4) for base in (1.0, 2.0, 5.0))


class Painted(NamedTuple):
    """Triangles in mm, shape (n, 3, 3), and their red, green and blue from 0 to 1, shape (n, 3)."""

    corners: Values
    rgb: Values


@dataclass(frozen=True)
class View:
    """Parallel projection from the direction `azimuth_deg` counterclockwise of X, `elevation_deg` above horizontal.

    What lies beyond `cut_mm` in the direction of the unit vector `away` is cut off.
    """

    azimuth_deg: float
    elevation_deg: float
    away: tuple[float, float, float] = (0.0, 0.0, 1.0)
    cut_mm: float = math.inf

    @cached_property
    def axes(self) -> Values:
        """Unit vectors to the right, upward and towards the eye as rows, shape (3, 3)."""
        around, above = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        right = np.array([-math.sin(around), math.cos(around), 0.0])
        toward = np.array([math.cos(above) * math.cos(around), math.cos(above) * math.sin(around), math.sin(above)])
        return np.array([right, np.cross(toward, right), toward])

    def beyond(self, points: Values) -> Values:
        """Distance beyond the cut in mm of points of shape (..., 3); negative for what is shown."""
        return np.asarray(points @ np.array(self.away) - self.cut_mm)

    def window(self, points: Values) -> "Window":
        """What the picture of `points`, shape (n, 3), takes; those beyond the cut do not count, those on its rim do."""
        seen = points[self.beyond(points) <= 1e-6] @ self.axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        half_width, half_height, _ = 0.5 * (high - low)
        return Window(0.5 * (low + high) @ self.axes, float(half_width), float(half_height))


class Window(NamedTuple):
    """Part of space that a picture shows: its middle, shape (3,), and half its width and height, in mm."""

    middle: Values
    half_width_mm: float
    half_height_mm: float

    def as_large_as(self, others: Iterable["Window"]) -> "Window":
        """Around the same middle, as wide and as high as the largest: pictures side by side then have one scale."""
        largest = [max(sides) for sides in zip(*(other[1:] for other in (self, *others)), strict=True)]
        return Window(self.middle, *largest)

    def with_margin(self, margin_mm: float) -> "Window":
        """Larger by `margin_mm` on every side."""
        return Window(self.middle, self.half_width_mm + margin_mm, self.half_height_mm + margin_mm)

    @property
    def aspect(self) -> float:
        """Height over width."""
        return self.half_height_mm / self.half_width_mm


def shaded(
    view: View,
    corners: Values,
    values: Values,
    normals: Values,
    colors: ScalarMappable,
    white: float = 0.0,
    levels: Sequence[float] = (),
) -> Painted:
    """Faces of a closed surface that face the eye, lit, in small pieces.

    Parameters
    ----------
    corners:
        In mm, shape (faces, 3, 3).
    values:
        At the corners, shape (faces, 3), interpolated in between.
    normals:
        Outward unit normals at the corners, shape (faces, 3, 3).
    colors:
        The colours of the values.
    white:
        Share of white in all colours.
    levels:
        Where colours change, if they do in bands: the faces are divided there.
    """
    brightness = _AMBIENT + (1.0 - _AMBIENT) * np.clip(normals @ (_LIGHT @ view.axes), 0.0, 1.0)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    pieces = np.concatenate([corners, values[..., None], brightness[..., None]], axis=2)[across @ view.axes[2] > 0.0]
    pieces = divided(pieces, 3, levels)
    for _ in range(_ROUNDS):
        beyond = view.beyond(pieces[..., :3])
        split = (beyond.min(axis=1) < 0.0) & (beyond.max(axis=1) > 0.0) | (len(pieces) < _FEW)
        if not len(levels):
            split |= np.ptp(pieces[..., 3], axis=1) > _SHADE * np.ptp(colors.get_clim())
        coarse = pieces[split]
        middles = 0.5 * (coarse + np.roll(coarse, -1, axis=1))
        tips = [np.stack([coarse[:, i], middles[:, i], middles[:, i - 1]], axis=1) for i in range(3)]
        pieces = np.concatenate([pieces[~split], middles, *tips])
    beyond = view.beyond(pieces[..., :3])
    shown = beyond.min(axis=1) < 0.0
    pieces, beyond = pieces[shown], beyond[shown]
    # The pieces that the cut goes through are small enough to be flattened onto it.
    pieces[..., :3] -= np.maximum(beyond, 0.0)[..., None] * np.array(view.away)
    flat = pieces.mean(axis=1)
    return Painted(pieces[..., :3], (white + (1.0 - white) * colors.to_rgba(flat[:, 3])[:, :3]) * flat[:, 4:])


def strokes(view: View, lines: Values, rgb: Values, width_mm: float, lift_mm: float) -> Painted:
    """Straight lines, shape (lines, 2, 3), in colours of shape (lines, 3), as bands that face the eye.

    They are lifted towards the eye, which in parallel projection is not seen but puts them before what they lie on.
    """
    right, upward, toward = view.axes
    # Only short pieces are sorted well by the depths of their centres, and end close to the cut.
    ends = lines[:, :1] + np.linspace(0.0, 1.0, _PARTS + 1)[:, None] * (lines[:, 1:] - lines[:, :1])
    lines, rgb = np.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2, 3), np.repeat(rgb, _PARTS, axis=0)
    shown = view.beyond(lines.mean(axis=1)) <= 1e-6
    lines, rgb = lines[shown], rgb[shown]
    along = lines[:, 1] - lines[:, 0]
    across = np.outer(along @ right, upward) - np.outer(along @ upward, right)
    across *= 0.5 * width_mm / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    start, end = (lines + lift_mm * toward).transpose(1, 0, 2)
    first = np.stack([start - across, start + across, end + across], axis=1)
    second = np.stack([start - across, end + across, end - across], axis=1)
    return Painted(np.concatenate([first, second]), np.concatenate([rgb, rgb]))


def pen(view: View, lines: Values, size_mm: float, grey: float = 0.2) -> Painted:
    """Lines of shape (lines, 2, 3) in mm that mark the edges of a body of this size; `grey` is their brightness."""
    return strokes(view, lines, np.full((len(lines), 3), grey), size_mm / 330, size_mm / 50)


def show(axis: Axes, view: View, layers: Sequence[Sequence[Painted]], window: Window) -> None:
    """Draw what `window` shows on `axis`; later layers cover earlier ones.

    Within a layer, what is nearer to the eye covers what is farther, by the centres of the triangles.
    """
    right, upward, toward = view.axes
    for zorder, layer in enumerate(layers):
        corners, rgb = (np.concatenate(parts) for parts in zip(*layer, strict=True))
        if not len(corners):
            continue
        order = np.argsort(corners.mean(axis=1) @ toward, kind="stable")
        flat = corners[order].reshape(-1, 3)
        triangles = Triangulation(flat @ right, flat @ upward, np.arange(len(flat)).reshape(-1, 3))
        # Triangles with colours at their corners are drawn by Agg in one call, and half a pixel larger than they are,
        # so that the background does not shine through between them.
        mesh = TriMesh(triangles, zorder=zorder)
        mesh.set_facecolor(np.repeat(rgb[order], 3, axis=0))
        axis.add_collection(mesh, autolim=False)
    x, y = window.middle @ right, window.middle @ upward
    half_width, half_height = _MARGIN * window.half_width_mm, _MARGIN * window.half_height_mm
    axis.set(xlim=(x - half_width, x + half_width), ylim=(y - half_height, y + half_height), aspect="equal")
    # Ticks are not shown, but would be laid out all the same.
    for side in (axis.xaxis, axis.yaxis):
        side.set_visible(False)
    axis.set_axis_off()


def add_scale_bar(axis: Axes, view: View, window: Window) -> None:
    """A bar of a round length below the picture, on the left."""
    right, upward, _ = view.axes
    length = max((bar for bar in _BARS_MM if bar <= window.half_width_mm / 2.0), default=_BARS_MM[0])
    start = window.middle @ right - window.half_width_mm
    height = window.middle @ upward - 1.1 * window.half_height_mm
    axis.plot([start, start + length], [height, height], color="black", linewidth=3.0, clip_on=False)
    axis.annotate(
        f"{length:g} mm",
        (start + length, height),
        (5, 0),
        textcoords="offset points",
        annotation_clip=False,
        fontsize=TEXT_PT,
        va="center",
    )
