"""Conjugate gradients with smoothed aggregation, which knows the rigid motions: for meshes too large for factors.

Source: Vaněk, Mandel & Brezina 1996; pyamg's implementation.
"""

import numpy as np
from scipy.sparse import bsr_matrix
from scipy.sparse.linalg import LinearOperator, cg

from ...arrays import FloatArray
from ..stiffness import Stiffness
from .factorisation import NotFactorised, Solve

#: Residual that is left of a solve: enough for a preconditioner.
_TOLERANCE = 1e-2
_ITERATIONS = 200


class Multigrid:
    """See Factorisation.

    Parameters
    ----------
    points:
        Where the displacement's nodes are in mm, shape (nodes, 3).
    """

    def __init__(self, points: FloatArray) -> None:
        import pyamg

        self.name = f"conjugate gradients with multigrid (pyamg {pyamg.__version__})"
        self._hierarchy = pyamg.smoothed_aggregation_solver
        self._points = points

    def __call__(self, matrix: Stiffness) -> Solve:
        """See Factorisation."""
        free = matrix.pattern.free
        full = matrix.full().tocsr()
        if not np.isfinite(full.data).all() or not (full.diagonal() > 0.0).all():
            raise NotFactorised("the tangent stiffness is not positive definite: the solid is unstable there")
        # Where nodes are free or fixed as a whole, the matrix is one of blocks.
        whole = bool((free == free[:, :1]).all())
        operator = bsr_matrix(full, blocksize=(3, 3)) if whole else full
        hierarchy = self._hierarchy(
            operator, B=_rigid_motions(self._points)[free.ravel()], symmetry="symmetric", max_coarse=300
        )
        preconditioner: LinearOperator = hierarchy.aspreconditioner(cycle="V")

        def solve(right: FloatArray) -> FloatArray:
            # A solve that stops early is a worse preconditioner, which the equilibrium's iteration notices.
            solution, _ = cg(operator, right, rtol=_TOLERANCE, maxiter=_ITERATIONS, M=preconditioner)
            return np.asarray(solution)

        return solve


def _rigid_motions(points: FloatArray) -> FloatArray:
    """Three translations and three rotations, shape (3 nodes, 6)."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for number, axis in enumerate(np.eye(3)):
        motions[:, :, 3 + number] = np.cross(axis, points - points.mean(axis=0))
    return motions.reshape(-1, 6)
