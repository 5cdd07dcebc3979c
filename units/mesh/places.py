"""Points of a mesh that are no nodes: each by the nodes around it, for the linear interpolation of nodal fields."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..arrays import FloatArray, IntArray
from ..errors import InvalidInput
from .simplices import Mesh

#: Distance in mm from the plane or line of a mesh that is rounding.
_OFF_AXIS_MM = 1e-6


class Places:
    """Where `points` (mm), shape (points, 3), lie in `mesh`: in the element that holds each of them.

    A point outside of the mesh takes the nearest place of it. `lowest`, shape (points,), tells how far outside it is:
    the lowest of its barycentric coordinates in the element where that is highest; negative outside, and minus infinity
    off the plane or line of a mesh of fewer dimensions.

    Raises
    ------
    InvalidInput
        For points without a nearest place: not finite, or so far away that their distance is not.
    """

    def __init__(self, mesh: Mesh, points: Sequence[Sequence[float]] | FloatArray) -> None:
        corners = mesh.points[mesh.cells]
        edges = (corners[:, 1:] - corners[:, :1])[:, :, : mesh.dimension]
        inverse = np.asarray(np.linalg.inv(edges), dtype=np.float64)
        given = np.reshape(np.asarray(points, dtype=np.float64), (len(points), 3))
        located = [_locate(mesh, corners, inverse, point) for point in given]
        self._places = [(nodes, weights) for nodes, weights, _ in located]
        self.lowest = np.array([lowest for *_, lowest in located])

    def __call__(self, field: FloatArray) -> FloatArray:
        """The values of a nodal field, shape (nodes,), at the points, shape (points,)."""
        return np.array([weights @ field[nodes] for nodes, weights in self._places])


def _locate(
    mesh: Mesh, corners: FloatArray, inverse: FloatArray, point: FloatArray
) -> tuple[IntArray, FloatArray, float]:
    """Nodes, their weights, and the lowest barycentric coordinate."""
    with np.errstate(over="ignore", invalid="ignore"):
        offset = point - corners[:, 0]
        others = np.einsum("ei,eij->ej", offset[:, : mesh.dimension], inverse)
        coordinates = np.column_stack([1.0 - others.sum(axis=1), others])
        # Meshes of fewer dimensions lie in the first axes; off them is outside.
        coordinates[np.abs(offset[:, mesh.dimension :]).max(axis=1, initial=0.0) > _OFF_AXIS_MM] = -np.inf
        element = int(coordinates.min(axis=1).argmax())
        lowest = float(coordinates[element].min())
        if lowest >= 0.0:
            return mesh.cells[element], coordinates[element], lowest
        return *_nearest(mesh, point), lowest


def _nearest(mesh: Mesh, point: FloatArray) -> tuple[IntArray, FloatArray]:
    """Nodes and weights of the place that is nearest to `point`: the best of the feet of its perpendiculars.

    Each foot is that on a corner, edge, face or whole element, and counts where that holds it. No element is looked at
    whose nodes are all farther away than the nearest node and the longest edge.
    """
    with np.errstate(over="ignore"):
        away = np.linalg.norm(mesh.points - point, axis=1)
    if not np.isfinite(away).all():
        raise InvalidInput(f"the point {point.tolist()} lies far outside the mesh")
    cells = mesh.cells[away[mesh.cells].min(axis=1) <= away.min() + _longest_edge(mesh)]
    closest, nodes, weights = np.inf, np.empty(0, dtype=np.int64), np.empty(0)
    for count in range(1, mesh.dimension + 2):
        for part in combinations(range(mesh.dimension + 1), count):
            vertices = cells[:, part]
            origin = mesh.points[vertices[:, 0]]
            edges = mesh.points[vertices[:, 1:]] - origin[:, None]
            along = np.linalg.solve(edges @ edges.transpose(0, 2, 1), edges @ (point - origin)[:, :, None])[:, :, 0]
            coordinates = np.column_stack([1.0 - along.sum(axis=1), along])
            foot = np.einsum("ev,evi->ei", coordinates, mesh.points[vertices])
            distance = np.linalg.norm(point - foot, axis=1)
            distance[~((coordinates >= 0.0).all(axis=1) & np.isfinite(distance))] = np.inf
            best = int(distance.argmin())
            if distance[best] < closest:
                closest, nodes, weights = float(distance[best]), vertices[best], coordinates[best]
    if not np.isfinite(closest):
        raise InvalidInput(f"the point {point.tolist()} lies far outside the mesh")
    return nodes, weights


def _longest_edge(mesh: Mesh) -> float:
    """In mm; 0 for single points."""
    pairs = combinations(range(mesh.dimension + 1), 2)
    lengths = (np.linalg.norm(mesh.points[mesh.cells[:, a]] - mesh.points[mesh.cells[:, b]], axis=1) for a, b in pairs)
    return max((float(length.max()) for length in lengths), default=0.0)
