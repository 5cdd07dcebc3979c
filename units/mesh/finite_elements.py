"""Linear finite elements on the shared mesh: the basis for scikit-fem's forms, and gradients for hand-made kernels."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from skfem import Basis, ElementLineP1, ElementTetP1, ElementTriP1, MeshLine, MeshTet, MeshTri

from ..arrays import FloatArray
from .simplices import Mesh

#: Mesh and element of scikit-fem by dimension.
_LINEAR = {1: (MeshLine, ElementLineP1), 2: (MeshTri, ElementTriP1), 3: (MeshTet, ElementTetP1)}


def linear_basis(mesh: Mesh) -> Basis:
    """scikit-fem's P1 basis, which single points have none of; degrees of freedom are the nodes, in their order."""
    kind, element = _LINEAR[mesh.dimension]
    # scikit-fem wants its arrays with the long axis last in memory.
    points = np.ascontiguousarray(mesh.points[:, : mesh.dimension].T)
    return Basis(kind(points, np.ascontiguousarray(mesh.cells.T)), element())


def interpolation(basis: Basis) -> tuple[csr_matrix, FloatArray]:
    """From nodes to the points of the basis' quadrature rule, shape (points, nodes), and the points' weights in mm³."""
    values = np.stack([np.broadcast_to(np.asarray(basis.basis[k][0]), basis.dx.shape) for k in range(basis.Nbfun)])
    points = np.arange(basis.dx.size).reshape(basis.dx.shape)
    rows = np.broadcast_to(points, values.shape)
    columns = np.broadcast_to(basis.element_dofs[:, :, None], values.shape)
    matrix = coo_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(basis.dx.size, basis.N))
    return csr_matrix(matrix), np.asarray(basis.dx).ravel()


def shape_gradients(mesh: Mesh) -> FloatArray:
    """Gradients (1/mm) of a tetrahedron's shape functions, constant per element, shape (elements, 4, 3)."""
    edges = mesh.points[mesh.cells[:, 1:]] - mesh.points[mesh.cells[:, :1]]
    last_three = np.linalg.inv(edges).transpose(0, 2, 1)
    return np.concatenate([-last_three.sum(axis=1, keepdims=True), last_three], axis=1)
