"""How long the runs of a study are, and how often they have outputs: so many steps, or as long as others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, isfinite
from typing import Any

from ..orchestrator.errors import InputError
from ..orchestrator.scenario import Coupling, Scenario, with_settings

#: The keys of a scenario that a span sets.
STOP, EVERY = "run.stop_ms", "output.every_ms"


@dataclass(frozen=True)
class Span:
    """Values of `run.stop_ms` and `output.every_ms`."""

    stop_ms: float
    every_ms: float

    @classmethod
    def of(cls, scenario: Scenario) -> "Span":
        """That of a scenario."""
        return cls(scenario.run.stop_ms, scenario.output.every_ms)

    @classmethod
    def around(cls, scenarios: Sequence[Scenario]) -> "Span":
        """The longest one, with outputs at the ends of all."""
        ends = [_decimal(scenario.run.stop_ms) for scenario in scenarios]
        whole = 1
        for end in ends:
            whole = whole * end.denominator // gcd(whole, end.denominator)
        return cls(float(max(ends)), float(Fraction(gcd(*(int(end * whole) for end in ends)), whole)))

    def set_in(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """A copy of a scenario's `content` with it."""
        return with_settings(content, {STOP: self.stop_ms, EVERY: self.every_ms})


def with_steps(content: Mapping[str, Any], steps: int) -> dict[str, Any]:
    """A copy of a scenario's `content` whose run has so many communication steps, and outputs at its end.

    InputError for adaptive coupling, which chooses their number by itself.
    """
    coupling = content.get("coupling")
    coupling = coupling if isinstance(coupling, Mapping) else {}
    if coupling.get("adaptive") is not None:
        raise InputError(
            "`steps` counts communication steps, and `coupling.adaptive` chooses their number; remove one of the two"
        )
    step = coupling.get("step_ms", Coupling().step_ms)
    # What is no step is told when all of the scenario is checked.
    if isinstance(step, bool) or not isinstance(step, int | float) or not isfinite(step):
        return dict(content)
    stop_ms = float(_decimal(step) * steps)
    return Span(stop_ms, stop_ms).set_in(content)


def _decimal(number: float) -> Fraction:
    """The number as it is written: three steps of 0.1 are 0.3, without the rounding of binary numbers."""
    return Fraction(repr(number))
