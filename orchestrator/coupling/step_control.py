"""How long the next communication step is, and whether the last one was good enough."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any, Protocol

import numpy as np

from ..participants.participant import Participant, Values
from .deviation import deviations
from .exchange import Exchange
from .missed_tolerance import Missed, MissedTolerance
from .timeline import Timeline

#: How far a ratio of times may be from a whole number and still be taken for rounding.
_ROUNDING = 1e-9

#: Error relative to the tolerance below which it does not matter how small it is.
_NO_ERROR = 1e-6


#: Change of an output, relative to its magnitude, that is rounding.
_NO_CHANGE = 1e-12


@dataclass(frozen=True)
class Verdict:
    """Whether a step is accepted; its estimated error over the tolerance, if there is an estimate.

    One that `missed` the tolerance is accepted all the same, because it cannot be any shorter.
    """

    accepted: bool
    error: float | None = None
    missed: bool = False


class StepControl(Protocol):
    """Chooses the steps of a run. It is asked for each step and judges how it went."""

    #: Whether it may refuse a step, which then has to be rolled back.
    refuses: bool
    #: Past values that its error estimate needs.
    depth: int

    def next(self, tick: int) -> int:
        """Ticks of the step from `tick` on."""

    def judge(self, exchange: Exchange, ticks: int) -> Verdict:
        """Judge a step of so many ticks; if it is not accepted, the next one is shorter."""

    def shorten(self, ticks: int) -> bool:
        """A step of so many ticks failed: make the next one shorter. False where it cannot be any shorter."""

    def missed(self) -> Missed:
        """The steps that missed the tolerance because they could not be any shorter, by what is known now."""

    def memory(self) -> dict[str, Any]:
        """What it has learned, for a checkpoint."""

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""


class FixedStep:
    """One tick at a time, whatever comes."""

    refuses = False
    depth = 1

    def next(self, tick: int) -> int:
        """See StepControl."""
        return 1

    def judge(self, exchange: Exchange, ticks: int) -> Verdict:
        """See StepControl."""
        return Verdict(True)

    def shorten(self, ticks: int) -> bool:
        """See StepControl."""
        return False

    def missed(self) -> Missed:
        """See StepControl."""
        return Missed()

    def memory(self) -> dict[str, Any]:
        """See StepControl."""
        return {}

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See StepControl."""


class AdaptiveStep:
    """Steps whose estimated error is near the tolerance, by a PI controller (Gustafsson 1991).

    The error of a step is that of its inputs (`deviation`): the root mean square over a field, relative to the largest
    magnitude that the field's change over the run has had. The worst counts. For ramped inputs it is that of
    extrapolation, the distance from the line through the two values before, about eight times what an interpolated
    input is wrong by in its middle; for held ones it is half the change over the step, so that steps are short. The
    first step is not judged: there is nothing yet to compare its changes with.

    Parameters
    ----------
    timeline:
        The run's time axis; steps end at its outputs.
    tolerance:
        Of the error of a step.
    min_ms, max_ms:
        Limits of a step; one that has to hit an output may be shorter.
    first_ms:
        The first step.
    participants:
        The units, which may follow their inputs inside a step or hold them.
    """

    refuses = True
    depth = 2

    _SAFETY, _SMALLEST, _LARGEST = 0.9, 0.2, 2.0
    # Exponents over the order of the estimate: the error of a line grows with the square of the step.
    _INTEGRAL, _PROPORTIONAL = 0.7 / 2.0, 0.4 / 2.0
    #: Factor above the tolerance from which a step is repeated: a repetition costs more than a slightly larger error.
    _REFUSED = 2.0

    def __init__(
        self,
        timeline: Timeline,
        tolerance: float,
        min_ms: float,
        max_ms: float,
        first_ms: float,
        participants: Mapping[str, Participant],
    ) -> None:
        self._timeline = timeline
        self._participants = participants
        self._tolerance = tolerance
        self._shortest = max(1, ceil(min_ms / timeline.tick_ms - _ROUNDING))
        self._longest = max(self._shortest, int(max_ms / timeline.tick_ms + _ROUNDING))
        self._wanted = min(max(first_ms / timeline.tick_ms, self._shortest), self._longest)
        # Every attempt at a step is shorter than the one before.
        self._ceiling = self._longest
        # Error over tolerance of the last accepted step.
        self._before = 1.0
        self._origins: dict[str, Values] = {}
        self._ranges: dict[str, float] = {}
        self._missed = MissedTolerance()

    def next(self, tick: int) -> int:
        """See StepControl. The way to the next output is divided evenly, so that no short step is left of it.

        A step may be longer than wanted for that, as far as its error is not expected to make it refused.
        """
        left = self._timeline.next_event(tick)
        longest = max(1.0, min(self._wanted * self._REFUSED**0.5, self._ceiling))
        steps = ceil(left / longest - _ROUNDING)
        return ceil(left / steps)

    def judge(self, exchange: Exchange, ticks: int) -> Verdict:
        """See StepControl."""
        ranges = self._ranges_with(exchange)
        errors = {
            (name, order): magnitude / ranges[name] / self._tolerance
            for (name, order), magnitude in self._magnitudes(exchange).items()
            if name in ranges
        }
        worst = max(errors.values(), default=0.0)
        # An error of first order is squared, so that all grow with the square of the step.
        error = max((value ** (2 / order) for (_, order), value in errors.items()), default=0.0)
        above = error > self._REFUSED
        if above and ticks > self._shortest:
            self._wanted = max(self._shortest, ticks * max(self._SMALLEST, self._SAFETY * error**-0.5))
            self._ceiling = ticks - 1
            return Verdict(False, worst)
        # Only a step that is taken tells of the run: what a refused one went to, never was.
        self._ranges = ranges
        self._ceiling = self._longest
        if above:
            needed = {
                name: ranges[name] * value / self._REFUSED ** (order / 2)
                for (name, order), value in errors.items()
                if value ** (2 / order) > self._REFUSED
            }
            self._missed.add(exchange.end_ms, needed)
        # A step that was cut to hit an output tells what the one that was wanted would have done.
        length = max(float(ticks), self._wanted)
        error = max(error * (length / ticks) ** 2, _NO_ERROR)
        factor = self._SAFETY * error**-self._INTEGRAL * self._before**self._PROPORTIONAL
        factor = min(max(factor, self._SMALLEST), self._LARGEST)
        self._wanted = min(max(length * factor, self._shortest), self._longest)
        self._before = error
        return Verdict(True, worst, missed=above)

    def missed(self) -> Missed:
        """See StepControl."""
        return self._missed.counted(self._ranges)

    def shorten(self, ticks: int) -> bool:
        """See StepControl."""
        if ticks <= self._shortest:
            return False
        self._wanted = max(self._shortest, ticks * 0.5)
        self._ceiling = ticks - 1
        return True

    def memory(self) -> dict[str, Any]:
        """See StepControl."""
        return {
            "wanted": np.array(self._wanted),
            "before": np.array(self._before),
            "origins": dict(self._origins),
            "ranges": {name: np.array(value) for name, value in self._ranges.items()},
            "missed": self._missed.memory(),
        }

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See StepControl."""
        self._wanted, self._before = float(memory["wanted"]), float(memory["before"])
        self._origins = dict(memory["origins"])
        self._ranges = {name: float(value) for name, value in memory["ranges"].items()}
        self._missed.resume(memory["missed"])

    def _ranges_with(self, exchange: Exchange) -> dict[str, float]:
        """How far each field that took this step has moved over the run, this step included."""
        ranges = dict(self._ranges)
        for end in exchange.moving:
            if exchange.stepped(end):
                name, value = str(end), exchange.latest(end)
                origin = self._origins.setdefault(name, exchange.extrapolated(end, 0))
                change = _magnitude(value - origin)
                if change > _NO_CHANGE * max(_magnitude(value), _magnitude(origin)):
                    ranges[name] = max(ranges.get(name, 0.0), change)
        return ranges

    def _magnitudes(self, exchange: Exchange) -> dict[tuple[str, int], float]:
        """By field and order in the step, the largest of the step's deviations."""
        largest: dict[tuple[str, int], float] = {}
        for deviation in deviations(exchange, self._participants):
            key = str(deviation.end), deviation.order
            largest[key] = max(largest.get(key, 0.0), _magnitude(deviation.values))
        return largest


def _magnitude(values: Values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
