"""Numbers that respond to each other in a ring: the closed forms of loops with a gain, a delay, or a rate in them.

Of units `response`, each of which is fed by the one before it, in the order in which they step. With the ring's gain g,
the product of all:

1. all answer at once: under Gauss–Seidel the error is multiplied by g at every exchange, whatever the step; with n
   units under Jacobi by the nth root of |g|;
2. one has a delay of rate ε, inputs are held: by e^(−εH) + (1 − e^(−εH)) g, so that short steps stabilise whatever
   is below 1;
3. one answers to the rate of its input, c = a ρ/H: z² + c z − c = 0, stable where H > 2 a ρ, so that short steps
   destabilise (a: what the rest of the ring multiplies by, with the opposite sign).

Computed is the matrix from one exchange to the next, of the exact steps (`test_problems.response`): any of these
together, with inputs held or on lines, and extrapolated.
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..test_problems.response import Law
from .exchange_map import LinearUnit, Seen, exchange_map, spectral_radius
from .theory import Coupled, Setting, Theory


class Feedback(Theory):
    """Two or more units `response` in a ring."""

    name: ClassVar[str] = "feedback"
    formula: ClassVar[str] = "|g| < 1; with a delay |e^(−εH) + (1 − e^(−εH)) g| < 1; with a rate H > 2 a ρ"

    def amplification(self, coupled: Coupled) -> float:
        """See Theory; InvalidInput where fewer than two units are of that kind."""
        ring = [name for name, unit in coupled.units.items() if unit.kind == "response"]
        if len(ring) < 2:
            raise InvalidInput(f"the theory applies to two or more units 'response' in a ring, not to {len(ring)}")
        before = dict(zip(ring, [ring[-1], *ring[:-1]], strict=True))
        units = {name: _unit(coupled.units[name], before[name], coupled) for name in ring}
        return spectral_radius(exchange_map(units, coupled))


def _unit(setting: Setting, source: str, coupled: Coupled) -> LinearUnit:
    # Where the loop rests does not matter.
    law = replace(setting.group(Law), offset=0.0, disturbance=0.0)
    step_ms = coupled.step_ms

    def step(state: FloatArray, seen: Seen) -> tuple[FloatArray, FloatArray]:
        delayed, earlier = state
        first, last = seen.begin[0], seen.end[0]
        after = law.followed(delayed, law.target(first), law.target(last), step_ms)
        rate = (last - (first if coupled.linear else earlier)) / step_ms
        return np.stack([after, last]), (after + law.rate_gain_ms * rate)[None]

    return LinearUnit(2, 1, ((source, 0),), step)
