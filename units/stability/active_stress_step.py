"""The delay of the active stress by itself: how a step multiplies the distance of the tension from its target.

Forward Euler multiplies it by 1 − ε H, so that the faster rate ε₁ limits the step H to 2/ε₁; the exact step by
e^(−ε H), which is below 1 for any step. Between the rates ε₀ at rest and ε₁ in depolarised tissue, ε takes all values,
so that one of the two is the worst. The printed delay function has a negative rate where the tissue is depolarised.
"""

from math import exp, inf
from typing import ClassVar

from .theory import Coupled, Theory

_LARGEST_EXPONENT = 700.0


class ActiveStressStep(Theory):
    """One unit `active_stress`, whose step is the communication step."""

    name: ClassVar[str] = "active_stress_step"
    formula: ClassVar[str] = "|1 − ε₁ H| < 1 by forward Euler; e^(−ε₀ H) < 1 always by the exact step"
    of_exchange: ClassVar[bool] = False

    def amplification(self, coupled: Coupled) -> float:
        """See Theory."""
        parameters = coupled.only("active_stress").parameters
        rest, depolarised = float(parameters["slow_rate_per_ms"]), float(parameters["fast_rate_per_ms"])
        if parameters["delay_function"] == "as_printed":
            depolarised = 2.0 * rest - depolarised
        decays = [rate * coupled.step_ms for rate in (rest, depolarised)]
        if parameters.get("time_integration") == "forward_euler":
            return max(abs(1.0 - decay) for decay in decays)
        return max(exp(-decay) if -decay < _LARGEST_EXPONENT else inf for decay in decays)
