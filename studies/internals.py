"""How finely the units of a scenario solve inside: the parameters that they declare to decide their numerical error."""

from dataclasses import dataclass

from ..orchestrator.participants.accuracy import AccuracyParameter
from ..orchestrator.participants.native import accuracy_parameters
from ..orchestrator.scenario import Scenario


@dataclass(frozen=True)
class Internal:
    """A parameter that decides the numerical error of `unit`, as `declared`, and its `own` value in the scenario."""

    unit: str
    declared: AccuracyParameter
    own: float

    @property
    def key(self) -> str:
        """The key of the parameter in a scenario."""
        return f"units.{self.unit}.parameters.{self.declared.name}"

    def times(self, factor: float) -> float:
        """The own value times `factor`, as far as there is no limit to it; rounded to what a person would write."""
        rounded = float(f"{self.own * factor:.6g}")
        if self.declared.limit_is_allowed:
            return max(rounded, self.declared.lower_limit)
        return rounded if rounded > self.declared.lower_limit else float(self.declared.default)


def internals(scenario: Scenario, *kinds: str) -> list[Internal]:
    """The parameters of these kinds (`step`, `tolerance`, `mesh`) of all units, in the order of the scenario."""
    return [
        Internal(name, declared, entry.parameters.get(declared.name, declared.default))
        for name, entry in scenario.units.items()
        if entry.unit is not None
        for declared in accuracy_parameters(entry.unit).values()
        if declared.kind in kinds
    ]
