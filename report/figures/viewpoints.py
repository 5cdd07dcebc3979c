"""From where bodies are looked at, and where they are cut, the same in all figures.

The frame is that of all scenes: the base is at the top, at Z = 0, and both ventricles lie side by side along X.
"""

import numpy as np

from ...orchestrator.participants.participant import Values
from .scene import View

#: From the front and a little above; from the front and so far above that one looks into the cavities; from behind.
FRONT, TILTED, BACK = View(-70.0, 12.0), View(-78.0, 38.0), View(110.0, 12.0)

#: Straight down on the base.
ABOVE = View(-90.0, 90.0)

# Mean over all elements of |Y component| of the direction through the wall from which on the wall lies along X.
_FLAT = 0.9

# Part of the height below which a short-axis section lies.
_SHORT_AXIS = 0.6


def long_axis(points: Values, right_deg: float = 0.0, elevation_deg: float = 0.0) -> View:
    """The front half of a body with these nodes cut away, seen from so far to the right of the front and above it."""
    return View(
        right_deg - 90.0, elevation_deg, (0.0, -1.0, 0.0), -float(points[:, 1].min() + 0.5 * np.ptp(points[:, 1]))
    )


def through_wall(points: Values, sheet: Values, right_deg: float = 0.0, elevation_deg: float = 0.0) -> View:
    """The long-axis section, turned where the body is a piece of wall that it would not lead through.

    `sheet` are unit vectors through the wall, shape (elements, 3).
    """
    if np.abs(sheet[:, 1]).mean() < _FLAT:
        return long_axis(points, right_deg, elevation_deg)
    return View(right_deg, elevation_deg, (1.0, 0.0, 0.0), float(points[:, 0].min() + 0.5 * np.ptp(points[:, 0])))


def short_axis(points: Values, elevation_deg: float = 90.0) -> View:
    """The upper part of a body with these nodes cut away, seen from above."""
    return View(-90.0, elevation_deg, (0.0, 0.0, 1.0), float(points[:, 2].min() + _SHORT_AXIS * np.ptp(points[:, 2])))


def facing(normals: Values) -> View:
    """A view of a piece of surface with these normals, weighted by area: of a flat one obliquely from its own side.

    What bends around the body is seen from the front.
    """
    mean = normals.sum(axis=0) / np.linalg.norm(normals, axis=1).sum()
    if np.linalg.norm(mean[:2]) < 0.5:
        return FRONT
    return View(float(np.degrees(np.arctan2(mean[1], mean[0]))) + 20.0, 12.0)
