"""Static equilibrium of a solid: three methods, each slower and more robust than the one before.

A quasi-Newton method with factors of an earlier stiffness; Newton's method with a line search; and that again, with the
loads raised in increments. Without these safeguards it is Newton's method alone.
"""

from dataclasses import dataclass

import numpy as np

from ...arrays import FloatArray
from ...errors import StepFailure
from ...variable import Refinement, parameter
from ..solid import Solid
from .factored import Factored, Factors, NotConverged, Solution
from .factorisation import Factorisation
from .newton import Newton
from .plain_newton import PlainNewton
from .quasi_newton import QuasiNewton

#: Halvings of a load increment before giving up.
_LOAD_HALVINGS = 6


@dataclass(frozen=True)
class Convergence:
    """When an equilibrium counts as found."""

    equilibrium_tolerance: float = parameter(
        1e-6,
        "1",
        "largest nodal residual force, over shear modulus times element size squared; stretches err by a tenth of it",
        above=0.0,
        below=1e-2,
        refines=Refinement.TOLERANCE,
    )
    newton_iterations: int = parameter(
        25, "1", "Newton iterations before the load step is halved", at_least=1, below=1001
    )
    safeguards: str = parameter(
        "on",
        "1",
        "on: earlier factors first, then a line search, then load increments; off: Newton's method alone with full "
        "steps from the last equilibrium, to demonstrate why the safeguards are needed",
        choices=("on", "off"),
    )


class Equilibrium:
    """Equilibria of one solid.

    Parameters
    ----------
    solid:
        What is deformed.
    force_scale:
        Force in N that `Convergence.equilibrium_tolerance` is relative to.
    convergence:
        Tolerance and limit of Newton's method.
    factorisation:
        What solves with the stiffness.
    """

    def __init__(
        self, solid: Solid, force_scale: float, convergence: Convergence, factorisation: Factorisation
    ) -> None:
        factors, limit = Factors(solid, factorisation), convergence.equilibrium_tolerance * force_scale
        self._fast = QuasiNewton(solid, factors, limit)
        self._sure = Newton(solid, factors, limit, convergence.newton_iterations)
        self._plain = PlainNewton(solid, factors, limit, convergence.newton_iterations)
        self._safeguards = convergence.safeguards == "on"
        self._loads = solid.loads

    def solve(
        self, start: FloatArray, guess: FloatArray, before: FloatArray, loads: FloatArray, factored: Factored
    ) -> Solution:
        """The equilibrium under the `loads` (MPa).

        `start` is the equilibrium under the loads `before`; `guess` is where to begin. If that fails, the loads are
        raised from `before` in smaller and smaller increments, each from the equilibrium below it.

        Raises
        ------
        StepFailure
            When the smallest increment fails too; without safeguards, when Newton's method fails.
        """
        if not self._safeguards:
            return self._without_safeguards(start, loads, factored)
        for method in (self._fast, self._sure):
            try:
                return method.solve(guess, loads, factored)
            except NotConverged:
                pass
        solution, done, increment = Solution(start, factored), 0.0, 1.0
        while done < 1.0:
            target = min(done + increment, 1.0)
            try:
                present = before + target * (loads - before)
                solution = self._sure.solve(solution.displacement, present, solution.factored)
                done = target
                increment *= 2.0
            except NotConverged as failure:
                increment *= 0.5
                if increment < 0.5**_LOAD_HALVINGS:
                    stresses = loads[: self._loads]
                    largest = 1000.0 * stresses[np.abs(stresses).argmax()]
                    raise StepFailure(
                        f"no equilibrium was found beyond {100.0 * done:.0f} % of the change of the loads (the largest "
                        f"is {largest:.4g} kPa): {failure}. Load steps down to 1/{2**_LOAD_HALVINGS} were tried. Take "
                        "shorter communication steps, refine the mesh at that element, or check the active stress and "
                        "the pressures"
                    ) from None
        return solution

    def _without_safeguards(self, start: FloatArray, loads: FloatArray, factored: Factored) -> Solution:
        try:
            return self._plain.solve(start, loads, factored)
        except NotConverged as failure:
            raise StepFailure(
                f"{failure}. It was tried without safeguards; use safeguards: on, or take shorter communication steps"
            ) from None
