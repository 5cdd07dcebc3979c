"""How an equilibrium responds to small changes of its loads: the whole derivative of the forces, solved to round-off.

    K δu + B δs + Σ g δp = 0,   δs = δs_a + w K_a A ∂λ/∂u δu

K is the symmetric derivative of the forces at a held active stress, B are the forces of an active stress of 1 MPa at a
node, and g those of a pressure of 1 MPa. What the active stress gains by the stretch (`loads/active_stiffness`) is
unsymmetric and reaches beyond an element, so that K is factorised without it and s found by iteration:

    (1 + C K⁻¹ B) δs = δs_a − C K⁻¹ Σ g δp,   C = w K_a A ∂λ/∂u

C K⁻¹ B is the loop of active stress and stretch within the mechanics. It is smooth, so that it takes a dozen solves.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, gmres

from ..arrays import FloatArray
from ..errors import StepFailure
from .solid import Solid
from .solvers.factorisation import NotFactorised
from .solvers.superlu import SuperLU

#: What is left of the loop's residual, relative to it; iterations before it begins anew, and how often it may.
_TOLERANCE, _ITERATIONS, _RESTARTS = 1e-13, 60, 10


class Tangent:
    """A linear map from changes of the loads to changes of the displacement, and its transpose.

    Parameters
    ----------
    solid:
        What is deformed.
    displacement:
        Its equilibrium in mm, shape (nodes, 3).
    loads:
        The loads in MPa that it is under, as `Solid` has them.

    Raises
    ------
    StepFailure
        Where the derivative is singular: the solid has no equilibrium nearby. So do its methods.
    """

    def __init__(self, solid: Solid, displacement: FloatArray, loads: FloatArray) -> None:
        self._by_tension = solid.active_forces(displacement)
        self._by_pressure = solid.pressure_forces(displacement)
        #: ∂λ/∂u in 1/mm, shape (elements, unknowns).
        self.stretch = solid.stretch_gradient(displacement)
        dependence = solid.dependence(loads)
        self._gained: csr_matrix | None = None
        if dependence is not None:
            self._gained = diags_array(dependence.stiffness) @ solid.active_stiffness.average @ self.stretch
        try:
            # In double precision, whatever the equilibria are found with: nothing corrects what comes out.
            self._solve = SuperLU()(solid.tangent(displacement, solid.held(displacement, loads)))
        except NotFactorised as error:
            raise _singular(str(error)) from None

    def displacement(self, tension: FloatArray, pressures: Sequence[float] | FloatArray) -> FloatArray:
        """δu in mm of the free degrees of freedom, shape (unknowns,).

        `tension` is the change of the active stress in MPa, shape (vertices,), and `pressures` are those of the
        surface loads, shape (pressures,).
        """
        by_tension, gained, pressed = self._by_tension, self._gained, self._by_pressure.T @ pressures
        if gained is not None:
            right = tension - gained @ self._solve(pressed)
            tension = _looped(lambda column: gained @ self._solve(by_tension @ column), right)
        return -self._solve(by_tension @ tension + pressed)

    def loads(self, gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradients by tension and pressures, shapes (vertices,) and (pressures,), for one by u, shape (unknowns,)."""
        by_tension, gained = self._by_tension.T, self._gained
        if gained is not None:
            right = by_tension @ self._solve(gradient)
            found = _looped(lambda column: by_tension @ self._solve(gained.T @ column), right)
            gradient = gradient - gained.T @ found
        answer = -self._solve(gradient)
        return by_tension @ answer, self._by_pressure @ answer


def _looped(loop: Callable[[FloatArray], FloatArray], right: FloatArray) -> FloatArray:
    """The solution of (1 + loop) x = right, shape (vertices,)."""
    size = len(right)
    operator = LinearOperator((size, size), matvec=lambda column: column + loop(column), dtype=np.float64)
    found, left = gmres(operator, right, rtol=_TOLERANCE, atol=0.0, restart=_ITERATIONS, maxiter=_RESTARTS)
    if left:
        raise _singular("the loop of active stress and stretch has no solution")
    return np.asarray(found)


def _singular(reason: str) -> StepFailure:
    return StepFailure(f"the equilibrium has no derivative with respect to its loads there ({reason})")
