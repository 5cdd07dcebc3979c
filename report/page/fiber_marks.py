"""Fibres as short lines that lie on a drawn surface and move with it."""

from dataclasses import dataclass

import numpy as np

from ...orchestrator.participants.participant import Values
from ..figures.fiber_layout import fiber_lines
from ..figures.surface import Numbers
from .cutaway import Cutaway
from .shape import Shape

#: Least distance and length of the lines relative to the size of the body.
_SPACING, _LENGTH = 1 / 30, 1 / 24


@dataclass(frozen=True)
class FiberMarks:
    """Lines whose ends are means of the corners of a triangle, with weights that may be negative.

    Attributes
    ----------
    triangle:
        Of the cutaway, shape (lines,).
    weights:
        Of its corners at both ends, shape (lines, 2, 3).
    """

    triangle: Numbers
    weights: Values


def fiber_marks(shape: Shape, drawn: Cutaway, fiber: Values) -> FiberMarks:
    """Marks of the fibres per element, shape (elements, 3), evenly over a cutaway; as long all as they are at rest."""
    corners = drawn.at(shape.points)[drawn.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Slivers at the edge of a cut have no direction of their own.
    plain = np.flatnonzero(np.linalg.norm(across, axis=1) > 1e-6 * shape.size_mm**2)
    size = shape.size_mm
    lines, place = fiber_lines(corners[plain], fiber[drawn.element[plain]], _SPACING * size, _LENGTH * size)
    triangle = plain[place]
    # Where the ends are in the triangle's plane, from its first corner along two of its sides.
    sides = (corners[triangle, 1:] - corners[triangle, :1]).transpose(0, 2, 1)
    along = np.linalg.pinv(sides) @ (lines - corners[triangle, :1]).transpose(0, 2, 1)
    weights = np.stack([1.0 - along.sum(axis=1), along[:, 0], along[:, 1]], axis=2)
    return FiberMarks(triangle, weights)
