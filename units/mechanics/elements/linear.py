"""P1: displacement linear in each tetrahedron, strain constant; one integration point is exact."""

import numpy as np

from ...mesh import Mesh
from ...mesh.finite_elements import shape_gradients
from .space import FaceRule, Space

#: Of degree 2, for the products of two shape functions.
_FACE_POINTS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
_FACE_DERIVATIVES = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])


def linear(mesh: Mesh) -> Space:
    """The space of linear displacements on `mesh`."""
    rule = FaceRule(_FACE_POINTS, np.tile(_FACE_DERIVATIVES, (3, 1, 1)), np.full(3, 1.0 / 6.0))
    return Space(
        points=mesh.points,
        nodes=mesh.cells,
        gradients=shape_gradients(mesh)[:, None],
        weights=mesh.volumes[:, None],
        vertex_shares=np.full((1, 4), 0.25),
        face_rule=rule,
        face_nodes=lambda faces: faces,
    )
