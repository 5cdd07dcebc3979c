"""Linear finite elements on the shared mesh: matrices of the elements in closed form, gradients, and a quadrature rule.

scikit-fem's forms keep gradients and values at all quadrature points, several GB for a million tetrahedra; on linear
simplices everything is constant or known in closed form.
"""

import numpy as np
from scipy.sparse import csr_matrix
from skfem import ElementLineP1, ElementTetP1, ElementTriP1, MeshLine, MeshTet, MeshTri
from skfem import Mesh as GridMesh
from skfem.quadrature import get_quadrature

from ..arrays import FloatArray
from .simplices import Mesh

#: Mesh and element of scikit-fem by dimension.
_LINEAR = {1: (MeshLine, ElementLineP1), 2: (MeshTri, ElementTriP1), 3: (MeshTet, ElementTetP1)}


def as_scikit_fem(mesh: Mesh) -> GridMesh:
    """scikit-fem's mesh of the same nodes and elements, of which single points have none."""
    # scikit-fem wants its arrays with the long axis last in memory.
    points = np.ascontiguousarray(mesh.points[:, : mesh.dimension].T)
    return _LINEAR[mesh.dimension][0](points, np.ascontiguousarray(mesh.cells.T))


def quadrature(dimension: int) -> tuple[FloatArray, FloatArray]:
    """The rule of degree 2: barycentric coordinates, shape (points, corners), and weights that add up to 1."""
    element = _LINEAR[dimension][1]()
    points, weights = get_quadrature(element.refdom, 2)
    return np.vstack([1.0 - points.sum(axis=0), points]).T, weights / weights.sum()


def interpolation(mesh: Mesh) -> tuple[csr_matrix, FloatArray]:
    """From nodes to the points of that rule, shape (points, nodes), and the points' weights in mm³."""
    values, weights = quadrature(mesh.dimension)
    columns = np.repeat(mesh.cells.astype(np.int32), len(weights), axis=0)
    starts = np.arange(0, columns.size + 1, columns.shape[1], dtype=np.int32)
    data = np.tile(values, (mesh.elements, 1))
    matrix = csr_matrix((data.ravel(), columns.ravel(), starts), shape=(len(columns), mesh.nodes))
    return matrix, np.outer(mesh.volumes, weights).ravel()


def mass_matrices(mesh: Mesh) -> FloatArray:
    """∫ N_a N_b over each element: |e| (1 + δ_ab)/((d + 1)(d + 2)); of single points 1; (elements, d + 1, d + 1)."""
    corners = mesh.dimension + 1
    shares = (np.ones((corners, corners)) + np.eye(corners)) / (corners * (corners + 1))
    return mesh.volumes[:, None, None] * shares


def diffusion_matrices(mesh: Mesh, conductivity: FloatArray) -> FloatArray:
    """∫ ∇N_a · D ∇N_b with D of each element, shape (elements, 3, 3); of single points 0; (elements, d + 1, d + 1)."""
    if mesh.dimension == 0:
        return np.zeros((mesh.elements, 1, 1))
    gradients = shape_gradients(mesh)
    inside = conductivity[:, : mesh.dimension, : mesh.dimension]
    return np.asarray((mesh.volumes[:, None, None] * (gradients @ inside)) @ gradients.transpose(0, 2, 1))


def shape_gradients(mesh: Mesh) -> FloatArray:
    """Gradients (1/mm) of the shape functions, constant per element, shape (elements, dimension + 1, dimension)."""
    edges = (mesh.points[mesh.cells[:, 1:]] - mesh.points[mesh.cells[:, :1]])[:, :, : mesh.dimension]
    others = np.linalg.inv(edges).transpose(0, 2, 1)
    return np.concatenate([-others.sum(axis=1, keepdims=True), others], axis=1)
