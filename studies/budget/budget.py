"""An error budget: what each source adds to the error of each number that a run is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from ...orchestrator.results.comparison import stem_of, unit_of
from .source import Source


@dataclass(frozen=True)
class Contribution:
    """What a source adds to the error of a quantity, positive where it makes the value too large.

    Where `trusted`, `estimate` is Richardson's; else it is the difference to the finest run, or NaN where there is
    none, and `reason` says why and what would help. `finer` are the settings of the finest run.
    """

    source: str
    quantity: str
    value: float
    estimate: float
    order: float | None
    trusted: bool
    reason: str
    finer: str
    negligible: bool = False


@dataclass(frozen=True)
class Quantity:
    """A number that a run is asked for, as `headlines` names it, with all that is known of its error."""

    name: str
    value: float
    contributions: Sequence[Contribution]

    @property
    def unit(self) -> str:
        """Its unit of measure; empty where there is none."""
        return unit_of(self.name)

    @property
    def error(self) -> float:
        """The sum of the magnitudes of all contributions that are known."""
        return sum(abs(each.estimate) for each in self.contributions if isfinite(each.estimate))

    @property
    def spoken(self) -> str:
        """The name for a person."""
        stem = stem_of(self.name)
        if stem.startswith("activation_") and self.unit == "ms":
            return f"activation at {stem.removeprefix('activation_')}"
        for ending, which in (("_min", "smallest"), ("_max", "largest")):
            if stem.endswith(ending):
                return f"{which} {stem.removesuffix(ending).replace('_', ' ')}"
        return stem.replace("_", " ")


@dataclass(frozen=True)
class Budget:
    """The budget of the scenario `name`; `notes` are sentences for a person on what is not part of it."""

    name: str
    sources: Sequence[Source]
    quantities: Sequence[Quantity]
    notes: Sequence[str] = ()
