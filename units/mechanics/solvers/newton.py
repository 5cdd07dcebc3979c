"""Newton's method with a line search: slow, but it converges from far away."""

import numpy as np

from ...arrays import FloatArray, frozen, inner
from ..solid import Solid
from .factored import Factored, Factors, NotConverged, Solution, largest
from .newton_step import newton_step

#: Decrease of energy, relative to the slope, that a step has to bring (Armijo).
_SUFFICIENT = 1e-4
#: What may be left of the residual's work along the step; a whole step brings it to nearly zero.
_LESS_WORK = 0.5
#: Halvings of a step before giving up.
_HALVINGS = 12


class Newton:
    """Equilibria of `solid` to a residual of `limit` N in a number of `iterations` at the most."""

    def __init__(self, solid: Solid, factors: Factors, limit: float, iterations: int) -> None:
        self._solid, self._factors, self._limit, self._iterations = solid, factors, limit, iterations

    def solve(self, displacement: FloatArray, loads: FloatArray, factored: Factored) -> Solution:
        """The equilibrium reached from `displacement`, shape (nodes, 3), under `loads`; NotConverged if none is."""
        energy, residual = self._solid.energy_and_residual(displacement, loads)
        if not np.isfinite(energy):
            raise NotConverged("an element is inverted at the start of the iteration")
        for iteration in range(self._iterations + 1):
            if largest(residual) <= self._limit:
                return Solution(frozen(displacement), factored)
            if iteration == self._iterations:
                break
            factored = Factored.here(displacement, loads)
            step = newton_step(self._solid, self._factors.at(factored), displacement, loads, residual)
            ascends = self._solid.is_symmetric(loads) and inner(step, residual) >= 0.0
            if not np.isfinite(step).all() or ascends:
                raise NotConverged("the tangent stiffness is not positive definite: the solid is unstable there")
            displacement, energy, residual = self.search(displacement, loads, step, energy, residual)
        raise NotConverged(
            f"Newton's method left a residual of {largest(residual):.3g} N (limit {self._limit:.3g} N) after "
            f"{self._iterations} iterations"
        )

    def search(
        self, displacement: FloatArray, loads: FloatArray, step: FloatArray, energy: float, residual: FloatArray
    ) -> tuple[FloatArray, float, FloatArray]:
        """A fraction of the Newton step that inverts no element and lowers the energy, or the residual along it.

        Under loads that have no energy it lowers the residual.
        """
        symmetric = self._solid.is_symmetric(loads)
        slope = inner(step, residual)
        fraction = 1.0
        for _ in range(_HALVINGS):
            trial = self._solid.moved(displacement, fraction * step)
            # A trial that goes much too far overflows; its energy is infinite or NaN, and it is not taken.
            with np.errstate(over="ignore", invalid="ignore"):
                trial_energy, trial_residual = self._solid.energy_and_residual(trial, loads)
                less = abs(inner(step, trial_residual)) < _LESS_WORK * abs(slope)
                # Less work decides near the minimum, where the energy's decrease drowns in rounding, and under loads
                # that have no potential: a pressure on a surface whose rim moves.
                if symmetric:
                    lower = trial_energy <= energy + _SUFFICIENT * fraction * slope
                else:
                    lower = _norm(trial_residual) <= (1.0 - _SUFFICIENT * fraction) * _norm(residual)
            if less or lower:
                return trial, trial_energy, trial_residual
            fraction *= 0.5
        ratio = self._solid.volume_ratio(displacement)
        raise NotConverged(
            f"no part of the Newton step lowers the energy (element {int(ratio.argmin())} is compressed most, volume "
            f"ratio {ratio.min():.3g})"
        )


def _norm(residual: FloatArray) -> float:
    return float(np.sqrt(inner(residual, residual)))
