"""Communication steps that a scenario can have: those that divide its output interval and its end."""

from collections.abc import Iterator
from math import ceil, floor, log10

from ...orchestrator.scenario import Scenario, is_whole

#: Steps that a person would choose.
_MANTISSAS = (1.0, 2.0, 2.5, 5.0)

#: How far from the scenario's own step the others are looked for.
_SHORTEST, _LONGEST = 0.25, 20.0

#: How far a ratio may be from a whole number and still be one.
_WHOLE = 1e-9


def divides(step_ms: float, *times_ms: float) -> bool:
    """Whether each of the times is a whole number of steps."""
    return all(is_whole(time / step_ms) for time in times_ms)


def communication_steps(scenario: Scenario) -> list[float]:
    """Steps in ms, the longest first: the scenario's, its output interval, and round ones between and around them."""
    every, stop, own = scenario.output.every_ms, scenario.run.stop_ms, scenario.coupling.step_ms
    found = {own, every, *_round(own * _SHORTEST, own * _LONGEST)}
    return sorted((step for step in found if divides(step, every, stop)), reverse=True)


def step_below(scenario: Scenario, longest_ms: float) -> float:
    """The longest step of at most `longest_ms` that divides output interval and end."""
    every, stop = scenario.output.every_ms, scenario.run.stop_ms
    count = max(ceil(every / longest_ms * (1.0 - _WHOLE)), 1)
    while not divides(every / count, stop):
        count += 1
    return every / count


def _round(shortest: float, longest: float) -> Iterator[float]:
    for decade in range(floor(log10(shortest)), ceil(log10(longest)) + 1):
        for mantissa in _MANTISSAS:
            step = float(f"{mantissa}e{decade}")
            if shortest * (1.0 - _WHOLE) <= step <= longest * (1.0 + _WHOLE):
                yield step
