"""The step of Newton's method, also where the stiffness that is factorised is not all of the tangent.

An active stress that follows the stretch makes the tangent unsymmetric and wider than its pattern
(`loads/active_stiffness`). The residual's derivative along a direction is then taken by a difference, and the factors
are a preconditioner: a Jacobian-free Newton–Krylov method. Source: Knoll & Keyes 2004 (J. Comput. Phys. 193, 357–397).
"""

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from ...arrays import FloatArray, inner
from ..solid import Solid
from .factorisation import Solve

#: What is left of the residual of a step, relative to it, and iterations at the most.
_TOLERANCE, _ITERATIONS = 1e-3, 40
#: Displacement in mm by which the residual is differentiated, as the largest of a node.
_DIFFERENCE = 1e-6


def newton_step(
    solid: Solid, solve: Solve, displacement: FloatArray, loads: FloatArray, residual: FloatArray
) -> FloatArray:
    """The change of the unknowns that is to bring the `residual` (N) to zero, shape (unknowns,), in mm.

    `solve` solves with the stiffness at `displacement` (mm, shape (nodes, 3)) under `loads` (MPa).
    """
    if solid.is_symmetric(loads):
        return solve(-residual)

    def along(direction: FloatArray) -> FloatArray:
        largest = float(np.abs(direction).max())
        if not largest > 0.0:
            return np.zeros_like(residual)
        change = _DIFFERENCE / largest
        ahead = solid.residual(solid.moved(displacement, change * direction), loads)
        behind = solid.residual(solid.moved(displacement, -change * direction), loads)
        # Nowhere an equilibrium is sought does a micrometre invert an element.
        return np.full_like(residual, np.nan) if ahead is None or behind is None else (ahead - behind) / (2.0 * change)

    size = len(residual)
    operator = LinearOperator((size, size), matvec=lambda column: along(solve(column)), dtype=np.float64)
    found, _ = gmres(operator, -residual, rtol=_TOLERANCE, restart=_ITERATIONS, maxiter=1)
    step = solve(found)
    # Where the iteration found nothing useful, the symmetric part says where to go.
    return step if np.isfinite(step).all() and inner(step, step) > 0.0 else solve(-residual)
