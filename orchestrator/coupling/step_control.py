"""How long the next communication step is, and whether the last one was good enough."""

from collections.abc import Mapping
from math import ceil
from typing import Any, Protocol

import numpy as np

from ..participants.participant import Values
from .exchange import Exchange
from .timeline import Timeline

#: How far a ratio of times may be from a whole number and still be taken for rounding.
_ROUNDING = 1e-9

#: Error relative to the tolerance below which it does not matter how small it is.
_NO_ERROR = 1e-6


class StepControl(Protocol):
    """Chooses the steps of a run. Between two of them it is asked once for the next and told how each one went."""

    #: Whether it may refuse a step, which then has to be rolled back.
    refuses: bool
    #: Past values that its error estimate needs.
    depth: int

    def next(self, tick: int) -> int:
        """Ticks of the step from `tick` on."""

    def good(self, exchange: Exchange, ticks: int) -> bool:
        """Whether a step of so many ticks is to be accepted; if not, the next one is shorter."""

    def shorten(self, ticks: int) -> bool:
        """A step of so many ticks failed: make the next one shorter. False where it cannot be any shorter."""

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

    def good(self, exchange: Exchange, ticks: int) -> bool:
        """See StepControl."""
        return True

    def shorten(self, ticks: int) -> bool:
        """See StepControl."""
        return False

    def memory(self) -> dict[str, Any]:
        """See StepControl."""
        return {}

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See StepControl."""


class AdaptiveStep:
    """Steps whose estimated error is near the tolerance, by a PI controller (Gustafsson 1991).

    The error of a step is taken to be that of foretelling: of every exchanged field, the root mean square of what the
    step gave less the line through the two values before, relative to the largest magnitude that the field's change
    over the run has had. That is what an extrapolated input is wrong by at the end of the step, and about eight times
    what an interpolated one is wrong by in its middle. The worst field counts. The first step is not judged, for there
    is no line yet.

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
    """

    refuses = True
    depth = 2

    _SAFETY, _SMALLEST, _LARGEST = 0.9, 0.2, 2.0
    # Exponents over the order of the estimate: the error of a line grows with the square of the step.
    _INTEGRAL, _PROPORTIONAL = 0.7 / 2.0, 0.4 / 2.0
    #: Factor above the tolerance from which a step is repeated: a repetition costs more than a slightly larger error.
    _REFUSED = 2.0

    def __init__(self, timeline: Timeline, tolerance: float, min_ms: float, max_ms: float, first_ms: float) -> None:
        self._timeline = timeline
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

    def next(self, tick: int) -> int:
        """See StepControl. The way to the next output is divided evenly, so that no short step is left of it.

        A step may be longer than wanted for that, as far as its error is not expected to make it refused.
        """
        left = self._timeline.next_event(tick)
        longest = max(1.0, min(self._wanted * self._REFUSED**0.5, self._ceiling))
        steps = ceil(left / longest - _ROUNDING)
        return ceil(left / steps)

    def good(self, exchange: Exchange, ticks: int) -> bool:
        """See StepControl."""
        error = self._error(exchange) / self._tolerance
        if error > self._REFUSED and ticks > self._shortest:
            self._wanted = max(self._shortest, ticks * max(self._SMALLEST, self._SAFETY * error**-0.5))
            self._ceiling = ticks - 1
            return False
        self._ceiling = self._longest
        # A step that was cut to hit an output tells what the one that was wanted would have done.
        length = max(float(ticks), self._wanted)
        error = max(error * (length / ticks) ** 2, _NO_ERROR)
        factor = self._SAFETY * error**-self._INTEGRAL * self._before**self._PROPORTIONAL
        factor = min(max(factor, self._SMALLEST), self._LARGEST)
        self._wanted = min(max(length * factor, self._shortest), self._longest)
        self._before = error
        return True

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
        }

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See StepControl."""
        self._wanted, self._before = float(memory["wanted"]), float(memory["before"])
        self._origins = dict(memory["origins"])
        self._ranges = {name: float(value) for name, value in memory["ranges"].items()}

    def _error(self, exchange: Exchange) -> float:
        worst = 0.0
        for end in exchange.moving:
            name, value = str(end), exchange.latest(end)
            change = _magnitude(value - self._origins.setdefault(name, exchange.foretold(end, 0)))
            self._ranges[name] = max(self._ranges.get(name, 0.0), change)
            if self._ranges[name] > 0.0 and exchange.depth(end) > 1:
                worst = max(worst, _magnitude(value - exchange.foretold(end, 1)) / self._ranges[name])
        return worst


def _magnitude(values: Values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
