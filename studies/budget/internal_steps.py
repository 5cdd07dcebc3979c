"""The internal steps of units: of equal length in every communication step, and no longer than a parameter allows."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil, isclose

from ...orchestrator.scenario import Scenario
from ..internals import internals

#: How far a ratio of times may be from a whole number and still be taken for rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class InternalStep:
    """The internal step of `unit`, which the parameter `name` keeps below `longest_ms`, where exchanges are fixed.

    `whole_ms` is the step over which the master takes the unit.
    """

    unit: str
    name: str
    longest_ms: float
    whole_ms: float

    @property
    def key(self) -> str:
        """The key of the parameter in a scenario."""
        return f"units.{self.unit}.parameters.{self.name}"

    def taken_ms(self, level: int = 0) -> float:
        """The internal step with communication steps divided by 2 `level` times."""
        whole = self.whole_ms * 2.0**-level
        return whole / count(whole, self.longest_ms)

    def is_taken(self, step_ms: float, level: int) -> bool:
        """Whether the scenario as it is takes this internal step at a level."""
        return isclose(self.taken_ms(level), step_ms, rel_tol=_ROUNDING)

    def at_all_levels_ms(self, levels: Iterable[int]) -> float:
        """The longest step that divides the communication steps of all levels, and is no longer than is taken."""
        shortest = self.whole_ms * 2.0 ** -max(levels)
        return shortest / count(shortest, self.taken_ms())


def count(whole_ms: float, longest_ms: float) -> int:
    """Into how many equal steps no longer than `longest_ms` a step is divided."""
    return max(1, ceil(whole_ms / longest_ms - _ROUNDING))


def internal_steps(scenario: Scenario) -> list[InternalStep]:
    """Those of all units that have one."""
    step_ms, units = scenario.coupling.step_ms, scenario.units
    return [
        InternalStep(each.unit, each.declared.name, float(each.own), step_ms * units[each.unit].every)
        for each in internals(scenario, "step")
    ]
