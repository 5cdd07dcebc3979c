"""The two-mass oscillator: how long its steps between exchanges may be (Busch 2012; Schweizer, Li & Lu 2015).

Both are integrated exactly (`test_problems.mass`), so that the matrix from one exchange to the next is exact as well,
and the coupling is stable as long as its spectral radius is below 1. A unit that has no coupling spring of its own is
given the force of the other one (force–displacement); where both have one, each is given the other's displacement and
velocity (displacement–displacement).

The force that is exchanged is the one that its unit computed in its step, from what it saw of the other mass there:
under Jacobi that is an extrapolated place. A master that asked for the force anew, after it has set the new place,
would be stable for longer steps.
"""

from typing import ClassVar

import numpy as np

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..test_problems.mass import Suspension
from .exchange_map import LinearUnit, Seen, exchange_map, spectral_radius
from .theory import Coupled, Theory

_MS_PER_S = 1000.0

#: Places of the outputs.
_X, _V, _F = 0, 1, 2


class TwoMasses(Theory):
    """Two units `mass`, or FMUs of the same equation that have the parameters m, k, c, k_c and c_c."""

    name: ClassVar[str] = "two_masses"
    formula: ClassVar[str] = "ρ(A(H)) < 1, A the exact matrix from one exchange to the next"

    def amplification(self, coupled: Coupled) -> float:
        """See Theory; InvalidInput where there are not two masses that are coupled in one of the two ways."""
        return spectral_radius(exchange_map(linear_masses(coupled), coupled))


def linear_masses(coupled: Coupled) -> dict[str, LinearUnit]:
    """The two units, by their names and in the order in which they step."""
    chosen = {name: unit.group(Suspension) for name, unit in coupled.units.items() if unit.kind in ("mass", "fmu")}
    if len(chosen) != 2:
        raise InvalidInput(
            f"the theory applies to two masses, units or FMUs with m, k, c, k_c and c_c, not to {len(chosen)}"
        )
    free = [name for name, suspension in chosen.items() if not (suspension.k_c or suspension.c_c)]
    if len(free) == 2:
        raise InvalidInput("the theory applies to two coupled masses: give k_c or c_c to one of them, or to both")
    first, second = chosen
    other = {first: second, second: first}
    return {
        name: _unit(
            suspension,
            ((other[name], _F),) if name in free else ((other[name], _X), (other[name], _V)),
            coupled.step_ms / _MS_PER_S,
            coupled.units[name].kind == "fmu",
        )
        for name, suspension in chosen.items()
    }


def _unit(suspension: Suspension, inputs: tuple[tuple[str, int], ...], step_s: float, bends: bool) -> LinearUnit:
    propagator = suspension.propagator(step_s)

    def placed(seen: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        nothing = np.zeros_like(seen[0])
        return (seen[0], nothing, nothing) if len(seen) == 1 else (nothing, seen[0], seen[1])

    def step(motion: FloatArray, seen: Seen) -> tuple[FloatArray, FloatArray]:
        first, last, bend = (suspension.load(*placed(values)) for values in (seen.begin, seen.end, seen.bend))
        # The parabola has its curvature, and ends where it is said to.
        loads = np.stack([first, (last - first - 0.5 * bend) / step_s, bend / step_s**2])
        after = propagator @ np.vstack([motion, loads])
        _, position, velocity = placed(seen.end)
        return after, np.vstack([after, suspension.reaction(after[0], after[1], position, velocity)])

    return LinearUnit(2, 3, inputs, step, bends)
