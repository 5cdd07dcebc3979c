"""P2: displacement quadratic in each tetrahedron, with nodes at the middles of its straight edges.

Four integration points, of degree 2: what an energy of quadratic displacements needs for third order in the
displacement (Ciarlet 2002, section 4.1). Source of the points: Keast 1986; of those of faces: Dunavant 1985.
"""

import numpy as np

from ...arrays import IntArray
from ...mesh import Mesh
from ...mesh.faces import row_keys
from ...mesh.finite_elements import shape_gradients
from .space import FaceRule, Space

_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
_FACE_EDGES = ((0, 1), (1, 2), (2, 0))

_FAR, _NEAR = (5.0 + 3.0 * np.sqrt(5.0)) / 20.0, (5.0 - np.sqrt(5.0)) / 20.0
#: The integration points by their barycentric coordinates, of equal weight.
_POINTS = np.full((4, 4), _NEAR) + (_FAR - _NEAR) * np.eye(4)

#: Of degree 4 on faces, where the product of a shape function and two derivatives stands: coordinate and weight.
_FACE_ORBITS = ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322))


def quadratic(mesh: Mesh) -> Space:
    """The space of quadratic displacements on `mesh`."""
    ends = np.sort(mesh.cells[:, _EDGES], axis=2).reshape(-1, 2)
    keys, first, edge = np.unique(row_keys(ends, mesh.nodes), return_index=True, return_inverse=True)
    middles = 0.5 * mesh.points[ends[first]].sum(axis=1)
    barycentric = shape_gradients(mesh)
    # 4 λ_a ∇λ_b at the integration points, shape (elements, points, 4, 4, 3).
    of_vertices = np.einsum("pa,ebi->epabi", 4.0 * _POINTS, barycentric)
    gradients = np.concatenate(
        [
            np.einsum("pa,eai->epai", 4.0 * _POINTS - 1.0, barycentric),
            np.stack([of_vertices[:, :, a, b] + of_vertices[:, :, b, a] for a, b in _EDGES], axis=2),
        ],
        axis=2,
    )

    def face_nodes(faces: IntArray) -> IntArray:
        sides = faces[:, _FACE_EDGES].reshape(-1, 2)
        # Keys of two calls can be compared as long as two node numbers fit into one key.
        number = mesh.nodes + np.searchsorted(keys, row_keys(sides, mesh.nodes))
        return np.concatenate([faces, number.reshape(-1, 3)], axis=1)

    return Space(
        points=np.concatenate([mesh.points, middles]),
        nodes=np.concatenate([mesh.cells, mesh.nodes + edge.reshape(-1, 6)], axis=1),
        gradients=gradients,
        weights=np.repeat(0.25 * mesh.volumes[:, None], 4, axis=1),
        vertex_shares=_POINTS,
        face_rule=_face_rule(),
        face_nodes=face_nodes,
    )


def _face_rule() -> FaceRule:
    points, weights = [], []
    for near, weight in _FACE_ORBITS:
        for far in range(3):
            point = np.full(3, near)
            point[far] = 1.0 - 2.0 * near
            points.append(point)
            weights.append(0.5 * weight)
    at = np.array(points)
    slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corners = at * (2.0 * at - 1.0)
    sides = np.stack([4.0 * at[:, a] * at[:, b] for a, b in _FACE_EDGES], axis=1)
    of_corners = (4.0 * at - 1.0)[:, :, None] * slopes
    of_sides = np.stack(
        [4.0 * (at[:, a, None] * slopes[b] + at[:, b, None] * slopes[a]) for a, b in _FACE_EDGES], axis=1
    )
    return FaceRule(
        np.concatenate([corners, sides], axis=1), np.concatenate([of_corners, of_sides], axis=1), np.array(weights)
    )
