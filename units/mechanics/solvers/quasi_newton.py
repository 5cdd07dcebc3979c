"""The quasi-Newton method with a stale factor: an iteration costs one residual and one solve, and no stiffness."""

from dataclasses import replace

import numpy as np

from ...arrays import FloatArray, frozen
from ..solid import Solid
from .factored import Factored, Factors, NotConverged, Solution, largest
from .limited_memory import LimitedMemory

#: Iterations that factors may cost beyond one for every equilibrium, before a new factorisation is the cheaper way; it
#: takes as long as some twenty iterations on meshes of all sizes, and the sum matters little from 20 to 50.
_SPENT = 25
#: Iterations of one equilibrium after which its factors are too stale to end it.
_STALE = 12
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
            raise NotConverged("an element is inverted at the start of the iteration")
        self._memory.forget()
        size, since = largest(residual), 0
        for _ in range(_MOST_ITERATIONS):
            if size <= self._limit:
                spent = factored.spent + max(since - 1, 0)
                return Solution(frozen(displacement), replace(factored, spent=spent))
            if since == _STALE or factored.spent >= _SPENT:
                factored, since = Factored.here(displacement, loads), 0
                self._memory.forget()
            step = self._memory.step(residual, self._factors.at(factored))
            displacement = self._solid.moved(displacement, step)
            earlier, residual = residual, self._solid.residual(displacement, loads)
            before, size = size, np.inf if residual is None else largest(residual)
            if residual is None or not size <= _MOST_GROWTH * before:
                raise NotConverged("the quasi-Newton method diverges")
            self._memory.remember(step, residual - earlier)
            since += 1
        raise NotConverged(f"the quasi-Newton method left a residual of {size:.3g} N (limit {self._limit:.3g} N)")
