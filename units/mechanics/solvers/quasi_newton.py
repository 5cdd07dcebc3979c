"""The quasi-Newton method with a stale factor: an iteration costs one residual and one solve, and no stiffness."""

from ...arrays import FloatArray, frozen
from ..solid import Solid
from .factored import Factored, Factors, NotConverged, Solution, largest
from .limited_memory import LimitedMemory

#: Iterations with the same factors after which new ones are cheaper than going on; it matters little from 9 to 14.
_STALE = 10
#: Iterations after which the method gives up, and growth of the residual in one of them that it survives.
_MOST_ITERATIONS, _MOST_GROWTH = 40, 10.0


class QuasiNewton:
    """Equilibria of `solid` to a residual of `limit` N, without a line search: near the solution only."""

    def __init__(self, solid: Solid, factors: Factors, limit: float) -> None:
        self._solid, self._factors, self._limit = solid, factors, limit
        self._memory = LimitedMemory(solid.unknowns)

    def solve(self, displacement: FloatArray, loads: FloatArray, factored: Factored) -> Solution:
        """The equilibrium near `displacement`, shape (nodes, 3), under `loads`; NotConverged if none is found."""
        residual = self._solid.residual(displacement, loads)
        if residual is None:
            raise NotConverged("an element is inverted where the iteration starts")
        self._memory.forget()
        size, since = largest(residual), 0
        for _ in range(_MOST_ITERATIONS):
            if size <= self._limit:
                return Solution(frozen(displacement), factored)
            if since == _STALE:
                factored, since = Factored.here(displacement, loads), 0
                self._memory.forget()
            step = self._memory.step(residual, self._factors.at(factored))
            displacement = self._solid.moved(displacement, step)
            before, residual = residual, self._solid.residual(displacement, loads)
            if residual is None or not largest(residual) <= _MOST_GROWTH * size:
                raise NotConverged("the quasi-Newton method diverges")
            self._memory.remember(step, residual - before)
            size, since = largest(residual), since + 1
        raise NotConverged(f"the quasi-Newton method left a residual of {size:.3g} N (limit {self._limit:.3g} N)")
