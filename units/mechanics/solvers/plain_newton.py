"""Newton's method as it stands in textbooks: a new tangent for every step, and every step taken in full.

It converges quadratically near a solution, and from afar by luck. Nothing here keeps it from leaving for an inverted
element; `newton` and `equilibrium` are what it takes. Multigrid's solutions are not exact: with those it converges
linearly.
"""

import numpy as np

from ...arrays import FloatArray, frozen, inner
from ..solid import Solid
from .factored import Factored, Factors, NotConverged, Solution, largest
from .newton_step import newton_step


class PlainNewton:
    """Equilibria of `solid` to a residual of `limit` N in a number of `iterations` at the most."""

    def __init__(self, solid: Solid, factors: Factors, limit: float, iterations: int) -> None:
        self._solid, self._factors, self._limit, self._iterations = solid, factors, limit, iterations

    def solve(self, displacement: FloatArray, loads: FloatArray, factored: Factored) -> Solution:
        """The equilibrium reached from `displacement`, shape (nodes, 3), under `loads`; NotConverged if none is."""
        left = np.inf
        for iteration in range(self._iterations + 1):
            residual = self._solid.residual(displacement, loads)
            if residual is None or not np.isfinite(residual).all():
                raise NotConverged(f"Newton's method inverts an element, after {iteration} iterations")
            left = largest(residual)
            if left <= self._limit:
                return Solution(frozen(displacement), factored)
            if iteration == self._iterations:
                break
            factored = Factored.here(displacement, loads)
            step = newton_step(self._solid, self._factors.at(factored), displacement, loads, residual)
            ascends = self._solid.is_symmetric(loads) and inner(step, residual) >= 0.0
            if not np.isfinite(step).all() or ascends:
                raise NotConverged("the tangent stiffness is not positive definite: the solid is unstable there")
            displacement = self._solid.moved(displacement, step)
        raise NotConverged(
            f"Newton's method left a residual of {left:.3g} N (limit {self._limit:.3g} N) after "
            f"{self._iterations} iterations"
        )
