"""Conjugate gradients with smoothed aggregation, which knows the rigid motions: for meshes too large for factors.

Source: Vaněk, Mandel & Brezina 1996; pyamg's implementation.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from scipy.sparse import bsr_matrix
from scipy.sparse.linalg import LinearOperator

from ...arrays import FloatArray
from ...conjugate_gradients import conjugate_gradients
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
        motions = _rigid_motions(self._points)[free.ravel()]
        with _repeatable():
            hierarchy = self._hierarchy(operator, B=motions, symmetry="symmetric", max_coarse=300)
        cycle: LinearOperator = hierarchy.aspreconditioner(cycle="V")

        def solve(right: FloatArray) -> FloatArray:
            start = np.zeros_like(right)
            solution = conjugate_gradients(operator, right, start, _TOLERANCE, _ITERATIONS, cycle.matvec)
            # Where it does not get there, one cycle is a preconditioner still.
            return np.asarray(cycle.matvec(right)) if solution is None else solution

        return solve


@contextmanager
def _repeatable() -> Iterator[None]:
    """pyamg estimates spectral radii from vectors of NumPy's global generator: here always the same ones."""
    before = np.random.get_state()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


def _rigid_motions(points: FloatArray) -> FloatArray:
    """Three translations and three rotations, shape (3 nodes, 6)."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for number, axis in enumerate(np.eye(3)):
        motions[:, :, 3 + number] = np.cross(axis, points - points.mean(axis=0))
    return motions.reshape(-1, 6)
