"""The outcome of verifying an FMU: a verdict for every variable of every experiment."""

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """What a variable's comparison ended in; the value is for a person."""

    WITHIN = "within"
    DEVIATES = "DEVIATES"
    LACKING = "NOT IN THE FMU"
    LEFT_OUT = "not compared"

    @property
    def is_sound(self) -> bool:
        """Whether the FMU may have it and be verified."""
        return self in (Verdict.WITHIN, Verdict.LEFT_OUT)


@dataclass(frozen=True)
class Comparison:
    """A variable against its results.

    `deviation` is the largest one, at `time_s`, and `allowed` what it may be; both are in the variable's unit of
    measure, None where nothing was compared. It is infinite for what has no distance: texts that differ, no number.
    """

    variable: str
    verdict: Verdict
    deviation: float | None = None
    time_s: float | None = None
    allowed: float | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of an experiment; `failure` is what is wrong with the whole of it, in a sentence for a person."""

    experiment: str
    comparisons: tuple[Comparison, ...] = ()
    failure: str | None = None

    @property
    def compared(self) -> int:
        """How many variables were compared."""
        return sum(item.verdict in (Verdict.WITHIN, Verdict.DEVIATES) for item in self.comparisons)

    @property
    def is_verified(self) -> bool:
        """Whether all of it is as it should be."""
        return self.failure is None and all(item.verdict.is_sound for item in self.comparisons)


@dataclass(frozen=True)
class Verification:
    """What came of all experiments in an FMU, and notes on what was left out."""

    outcomes: tuple[Outcome, ...]
    notes: tuple[str, ...]

    @property
    def is_verified(self) -> bool:
        """Whether every experiment is as it should be, and there was something to compare."""
        return all(outcome.is_verified for outcome in self.outcomes) and any(item.compared for item in self.outcomes)

    @property
    def reasons(self) -> list[str]:
        """Why it is not, in sentences for a person."""
        found = []
        for outcome in self.outcomes:
            if outcome.failure is not None:
                found.append(f"experiment '{outcome.experiment}': {outcome.failure}")
            wrong = [item for item in outcome.comparisons if not item.verdict.is_sound]
            if wrong:
                found.append(
                    f"experiment '{outcome.experiment}': {len(wrong)} of {len(outcome.comparisons)} variables are not "
                    "as its results have them"
                )
        if not found and not self.is_verified:
            found.append("no variable of any experiment could be compared")
        return found
