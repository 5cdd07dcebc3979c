"""The surface of a body that is cut by a plane through the undeformed shape, with the cut closed.

The cut goes through the tissue, not through space: as the body deforms, the same tissue is seen on it. Every vertex
lies on an edge of the mesh or at a node, and so moves with two nodes.
"""

from dataclasses import dataclass

import numpy as np

from ...orchestrator.participants.participant import Values
from ..figures.surface import Numbers
from .shape import Shape

#: Faces that meet at this angle or more, in radians, make an edge that is drawn.
_KINK = np.radians(40.0)


@dataclass(frozen=True)
class Cutaway:
    """Triangles whose vertices are (1 − share) · start + share · end of two drawn nodes.

    Attributes
    ----------
    start, end, share:
        Of the vertices, shape (n,) each; at a node both are that node and `share` is 0.
    triangles:
        By these vertices, shape (m, 3).
    element:
        The element of each triangle, shape (m,).
    """

    start: Numbers
    end: Numbers
    share: Values
    triangles: Numbers
    element: Numbers

    def at(self, values: Values) -> Values:
        """Values of the drawn nodes, shape (nodes, ...), at the vertices."""
        share = self.share.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1.0 - share) * values[self.start] + share * values[self.end])

    def edges(self, points: Values) -> Numbers:
        """The vertices at the ends of the edges where the surface has a kink at rest, shape (edges, 2).

        `points` are the drawn nodes at rest. Open edges, as a sheet has, count too.
        """
        corners = self.at(points)[self.triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        # Vertices in one place are told apart only where there is an edge: here they are one.
        _, place = np.unique(np.stack([self.start, self.end], axis=1), axis=0, return_inverse=True)
        sides = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        ends = np.sort(place[sides], axis=1)
        _, first, inverse, count = np.unique(ends, axis=0, return_index=True, return_inverse=True, return_counts=True)
        total = np.zeros((len(first), 3))
        np.add.at(total, inverse, normal[np.arange(len(sides)) // 3])
        # Two unit vectors at an angle have a sum of length 2 cos(angle / 2).
        kinked = np.linalg.norm(total, axis=1) < 2.0 * np.cos(0.5 * _KINK)
        return np.asarray(sides[first[kinked & (count <= 2)]])


def whole(shape: Shape) -> Cutaway:
    """All of the surface; a node where it has an edge is a vertex of each side."""
    keys = np.stack([shape.triangles, shape.triangles, shape.corner_groups, shape.corner_groups], axis=2)
    return _joined(keys, np.zeros_like(shape.triangles, dtype=float), shape.element)


def cut(shape: Shape, away: Values, at_mm: float) -> Cutaway:
    """What is left where all beyond `at_mm` in the direction of the unit vector `away` is taken off."""
    height = shape.points @ away - at_mm
    # A node in the plane belongs to what is left: no triangle is without area.
    height[np.abs(height) < 1e-6 * shape.size_mm] = -1e-6 * shape.size_mm
    parts = [_kept(shape, height), _section(shape, height, away)]
    keys, share, element = (np.concatenate(each) for each in zip(*parts, strict=True))
    return _joined(keys, share, element)


def _kept(shape: Shape, height: Values) -> tuple[Numbers, Values, Numbers]:
    """The surface below the plane: vertices as keys, shape (m, 3, 4), their shares, shape (m, 3), and elements."""
    keys, shares, elements = [], [], []
    above = (height[shape.triangles] > 0.0).sum(axis=1)

    def add(number: Numbers, corners: list[tuple[Numbers, Numbers]]) -> None:
        """A triangle in each of the faces `number`, whose vertices lie between two of its corners each."""
        row = np.arange(len(number))
        nodes, groups = shape.triangles[number], shape.corner_groups[number]
        ends = [(nodes[row, one], nodes[row, two], groups[row, one], groups[row, two]) for one, two in corners]
        keys.append(np.stack([np.stack(each, axis=1) for each in ends], axis=1))
        shares.append(np.stack([_share(height[each[0]], height[each[1]]) for each in ends], axis=1))
        elements.append(shape.element[number])

    whole_ones = np.flatnonzero(above == 0)
    first, second, third = (np.full(len(whole_ones), place) for place in range(3))
    add(whole_ones, [(first, first), (second, second), (third, third)])
    for count in (1, 2):
        number = np.flatnonzero(above == count)
        # The corners from the lowest to the highest.
        low, middle, high = np.argsort(height[shape.triangles[number]], axis=1, kind="stable").T
        if count == 2:
            corners = [[(low, low), (low, middle), (low, high)]]
        else:
            corners = [[(low, low), (middle, middle), (low, high)], [(middle, middle), (middle, high), (low, high)]]
        # In this order the corners go around the face as they did, or the other way round.
        same = (middle - low) % 3 == 1
        for triangle in corners:
            for which, step in ((same, 1), (~same, -1)):
                add(number[which], [(one[which], two[which]) for one, two in triangle[::step]])
    return np.concatenate(keys), np.concatenate(shares), np.concatenate(elements)


def _section(shape: Shape, height: Values, away: Values) -> tuple[Numbers, Values, Numbers]:
    """The cut through the elements, as `_kept`, facing `away`."""
    keys = [np.empty((0, 3, 4), dtype=np.int64)]
    elements = [np.empty(0, dtype=np.int64)]
    above = (height[shape.cells] > 0.0).sum(axis=1)
    for count in (1, 2, 3):
        number = np.flatnonzero(above == count)
        order = np.argsort(-height[shape.cells[number]], axis=1, kind="stable")
        nodes = np.take_along_axis(shape.cells[number], order, axis=1)
        start, end = np.repeat(nodes[:, :count], 4 - count, axis=1), np.tile(nodes[:, count:], count)
        # Its own group, so that the surface has an edge where it is cut.
        key = np.stack([start, end, np.full_like(start, -1), np.full_like(start, -1)], axis=2)
        # Four crossings make two triangles; in this order they share the edge between the second and the third.
        for first in range(key.shape[1] - 2):
            keys.append(key[:, first : first + 3])
            elements.append(number)
    joined = np.concatenate(keys)
    share = _share(height[joined[..., 0]], height[joined[..., 1]])
    start, end = shape.points[joined[..., 0]], shape.points[joined[..., 1]]
    corners = start + share[..., None] * (end - start)
    back = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ away < 0.0
    joined[back], share[back] = joined[back, ::-1], share[back, ::-1]
    return joined, share, np.concatenate(elements)


def _share(start: Values, end: Values) -> Values:
    """Where the height is zero between two that have it of different signs; 0 where both are one node."""
    apart = start - end
    return np.asarray(np.divide(start, apart, out=np.zeros_like(start), where=apart != 0.0))


def _joined(keys: Numbers, share: Values, element: Numbers) -> Cutaway:
    """Vertices with the same key are one."""
    forward = keys[..., 0] <= keys[..., 1]
    keys = np.where(forward[..., None], keys, keys[..., [1, 0, 3, 2]])
    # An edge is crossed in one place, from whichever side it is looked at.
    share = np.where(forward | (keys[..., 0] == keys[..., 1]), share, 1.0 - share)
    unique, first, inverse = np.unique(keys.reshape(-1, 4), axis=0, return_index=True, return_inverse=True)
    return Cutaway(unique[:, 0], unique[:, 1], share.ravel()[first], inverse.reshape(-1, 3), element)
