"""How well shaped the elements of a mesh are."""

import numpy as np

from ..arrays import FloatArray
from .simplices import Mesh

# Edge vectors of the regular tetrahedron with edges of length 1, in columns.
_REGULAR = np.array(
    [
        [1.0, 0.5, 0.5],
        [0.0, np.sqrt(3.0) / 2.0, np.sqrt(3.0) / 6.0],
        [0.0, 0.0, np.sqrt(6.0) / 3.0],
    ]
)


def signed_inverse_condition_number(mesh: Mesh) -> FloatArray:
    """SICN of each element, shape (elements,): 1 for a regular tetrahedron, towards 0 for a flat one.

    With S the map from the regular tetrahedron to the element it is 3/(|S| |S⁻¹|) with the sign of det S, in the
    Frobenius norm: gmsh's quality measure `minSICN` for linear tetrahedra.
    """
    edges = np.swapaxes(mesh.points[mesh.cells[:, 1:]] - mesh.points[mesh.cells[:, :1]], 1, 2)
    S = edges @ np.linalg.inv(_REGULAR)
    condition = np.linalg.norm(S, axis=(1, 2)) * np.linalg.norm(np.linalg.inv(S), axis=(1, 2))
    return np.asarray(np.sign(np.linalg.det(S)) * 3.0 / condition)
