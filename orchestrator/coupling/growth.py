"""Whether exchanged fields alternate from step to step, and by which factor per step that grows.

An explicit loop of gain g multiplies errors by z at every exchange: z = g under Gauss–Seidel, zᵐ = g under Jacobi over
m units. Where g is negative these errors alternate, with a period of two steps under Gauss–Seidel, of 2m under Jacobi,
on top of whatever the field does.

What alternates is seen in the bend of a field x over its last three values,

    a_n = 2 / (1 + r) · (x_n − x_{n−1} − r (x_{n−1} − x_{n−2})),   r = h_n / h_{n−1},

its distance from the line through the two values before, so weighted that values of ±A in turn bend by 4A whatever the
sizes h of the steps. The bend of n is compared with those k = 1, 2, 3 steps earlier: where the cosine of the angle
between the two is below −0.75, the field alternates with the period 2k, and grows per step by the k-th root of
|a_n| / |a_{n−k}|. Smooth fields have cosines near 1. What may be mistaken for alternation is above the limit: a front
that moves on by more than its own width in every step has −1/2, in the mean over some steps, and noise that is
independent from step to step has −2/3.

A field is told of (`Alternation`) when it has alternated in each of eight steps, at a steady rate and by more than a
millionth of its motion. In a loop that is iterated it has to be a hundredth of the motion: what the criteria let pass
in one sweep is coupled explicitly, and grows as far as they do, but no further. Divergence that does not alternate, of
a loop of gain above 1, cannot be told from a field that has to grow, as in an upstroke, and is not looked for.
"""

from collections import deque
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import islice
from math import exp, log
from statistics import median
from typing import Any

import numpy as np

from ..participants.participant import Participant, Values
from .alternation import DECAYING, GROWING, KINDS, RINGING, Alternation
from .connections import Connection, End
from .exchange import Exchange
from .norm import norm

#: How many steps back a bend is compared with.
_LAGS = (1, 2, 3)

#: Cosine below which two bends are opposite. Noise that is independent from step to step has −2/3.
_OPPOSITE = -0.75

#: An alternation that does not grow rings on above this rate, if its amplitude over the field's motion is above that.
_RINGS, _LITTLE = 0.9, 1e-3

#: Steps of lag 1 from which on an alternation of lag 3 is the same.
_SAME = 3

#: Rates that differ by less are equal.
_EQUAL = 1e-9

#: Bend relative to the field's magnitude that is rounding.
_ROUNDING = 1e-12

#: Logarithm of the largest factor that is told as a number.
_LARGEST = 700.0


@dataclass(frozen=True)
class _Proof:
    """When an alternation is reported: after so many `steps` whose factors are the median of them within `steady`.

    The `rate` and the amplitude over the field's motion, `share`, have to be above these.
    """

    steps: int
    steady: float
    rate: float
    share: float


#: Alternations by less than a millionth of the motion may come from the tolerances inside of units.
_PROOF = _Proof(steps=8, steady=1.3, rate=0.0, share=1e-6)

#: The same in a loop that is iterated.
_PLAIN_PROOF = replace(_PROOF, share=1e-2)

#: What is enough in a run that has failed, which may not have had the time for more.
_SUSPICION = _Proof(steps=3, steady=1.5, rate=1.2, share=1e-2)


class Growth:
    """Follows all fields that are exchanged in every step and move continuously, of the `participants` connected.

    Of the fields `solved` ("unit.field") loops are iterated.

    Attributes
    ----------
    names:
        The fields, "unit.field", in the order of the connections.
    """

    def __init__(
        self,
        participants: Mapping[str, Participant],
        connections: Iterable[Connection],
        solved: Collection[str] = (),
    ) -> None:
        self._tracks: dict[End, _Track] = {}
        for link in connections:
            port = participants[link.source.unit].outputs[link.source.name]
            once = port.fixed or participants[link.target.unit].inputs[link.target.name].fixed
            if port.is_real and not port.discrete and not once:
                proof = _PLAIN_PROOF if str(link.source) in solved else _PROOF
                self._tracks.setdefault(link.source, _Track(proof))
        self.names = [str(end) for end in self._tracks]

    def begin(self, exchange: Exchange) -> None:
        """Take the initial values."""
        for end, track in self._tracks.items():
            track.begin(exchange.latest(end))

    def add(self, exchange: Exchange) -> dict[str, float | None]:
        """Take the values of a step that was accepted; by field, the factor by which its alternation grows.

        It is 0 where a field does not alternate, and None where too little is known of it yet. A field that is not new
        in this step, because its unit waits, has no entry.
        """
        return {
            str(end): track.add(exchange.end_ms, exchange.latest(end))
            for end, track in self._tracks.items()
            if exchange.stepped(end)
        }

    @property
    def found(self) -> dict[str, Alternation]:
        """By field, the worst alternation to be reported; fields that do not alternate have no entry."""
        return {str(end): track.worst for end, track in self._tracks.items() if track.worst is not None}

    @property
    def suspected(self) -> dict[str, Alternation]:
        """The same, if the run has failed now: fields that had begun to grow fast shortly before are growing."""
        found = self.found
        for end, track in self._tracks.items():
            suspicion = track.suspected()
            if suspicion is not None and suspicion.worse_than(found.get(str(end))):
                found[str(end)] = suspicion
        return found

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return {str(end): track.memory() for end, track in self._tracks.items()}

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        for end, track in self._tracks.items():
            track.resume(memory[str(end)])


class _Track:
    """The last values of one field, their last bends, and for how long these have been opposite."""

    def __init__(self, proof: _Proof) -> None:
        self._proof = proof
        self.worst: Alternation | None = None
        self._present: Alternation | None = None
        # Newest first: the last two values, the directions of the last bends (zero without a bend), and their lengths.
        self._values: deque[Values] = deque(maxlen=2)
        self._directions: deque[Values] = deque(maxlen=len(_LAGS))
        self._lengths: deque[float] = deque(maxlen=len(_LAGS))
        # The times in ms of the last two values, newest first.
        self._times: deque[float] = deque(maxlen=2)
        # By lag: for how many steps it has alternated; when the last of these began, and the logarithms of their
        # factors over the whole lag, newest first.
        self._counts = dict.fromkeys(_LAGS, 0)
        self._begins: dict[int, deque[float]] = {lag: deque(maxlen=_PROOF.steps) for lag in _LAGS}
        self._factors: dict[int, deque[float]] = {lag: deque(maxlen=_PROOF.steps) for lag in _LAGS}
        self._motion = self._magnitude = self._share = 0.0

    def begin(self, values: Values) -> None:
        """Take the initial value."""
        self._origin = values
        self._values.appendleft(values)
        self._times.appendleft(0.0)
        self._magnitude = norm(values)

    def add(self, time_ms: float, values: Values) -> float | None:
        """Take the value at `time_ms`; see `Growth.add`."""
        known, bent = len(self._directions) > 0, False
        self._magnitude = max(self._magnitude, norm(values))
        self._motion = max(self._motion, norm(values - self._origin))
        if len(self._values) > 1:
            direction, length = self._bend(time_ms, values)
            self._compare(direction, length)
            bent = length > 0.0
        self._values.appendleft(values)
        self._times.appendleft(time_ms)
        if bent:
            self._tell(time_ms)
        if not known:
            return None
        lag = max(_LAGS, key=lambda lag: (self._counts[lag], -lag))
        return _factor(self._factors[lag][0] / lag) if bent and self._counts[lag] else 0.0

    def suspected(self) -> Alternation | None:
        """The alternation to be reported of the last steps, if the run failed after them."""
        # A run may fail before it has any value.
        return self._judged(_SUSPICION, self._times[0]) if self._times else None

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        told = {"worst": self.worst, "present": self._present}
        return {
            "origin": self._origin,
            "values": {str(place): values for place, values in enumerate(self._values)},
            "directions": {str(place): values for place, values in enumerate(self._directions)},
            "lengths": np.array(self._lengths),
            "times_ms": np.array(self._times),
            "counts": np.array([self._counts[lag] for lag in _LAGS]),
            "begins_ms": {str(lag): np.array(self._begins[lag]) for lag in _LAGS},
            "factors": {str(lag): np.array(self._factors[lag]) for lag in _LAGS},
            "extent": np.array([self._motion, self._magnitude, self._share]),
            "told": {name: _numbers(found) for name, found in told.items() if found is not None},
        }

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        self._origin = memory["origin"]
        for kept, name in ((self._values, "values"), (self._directions, "directions")):
            kept.clear()
            kept.extend(memory[name][str(place)] for place in range(len(memory[name])))
        for numbers, name in ((self._lengths, "lengths"), (self._times, "times_ms")):
            numbers.clear()
            numbers.extend(memory[name].tolist())
        self._counts = dict(zip(_LAGS, memory["counts"].tolist(), strict=True))
        for lag in _LAGS:
            self._begins[lag].extend(memory["begins_ms"][str(lag)].tolist())
            self._factors[lag].extend(memory["factors"][str(lag)].tolist())
        self._motion, self._magnitude, self._share = memory["extent"].tolist()
        told = memory["told"]
        self.worst = _alternation(told["worst"]) if "worst" in told else None
        self._present = _alternation(told["present"]) if "present" in told else None

    # --- inside -------------------------------------------------------------------------------------------------------

    def _bend(self, time_ms: float, values: Values) -> tuple[Values, float]:
        """Direction and length of the bend at `values`; both zero where it is rounding, or leaves the numbers."""
        (before, earlier), (middle, first) = self._values, self._times
        ratio = (time_ms - middle) / (middle - first)
        with np.errstate(over="ignore", invalid="ignore"):
            bend = (2.0 / (1.0 + ratio)) * (values - before - ratio * (before - earlier))
            length = norm(bend)
        if not _ROUNDING * self._magnitude < length < np.inf:
            return np.zeros(values.size), 0.0
        return (bend / length).ravel(), length

    def _compare(self, direction: Values, length: float) -> None:
        """Compare a bend with those before it, and keep it."""
        for lag in _LAGS:
            before = self._lengths[lag - 1] if len(self._lengths) >= lag else 0.0
            if length == before == 0.0:
                # A value that is held over some steps says nothing in them.
                continue
            if before > 0.0 and float(direction @ self._directions[lag - 1]) < _OPPOSITE:
                self._counts[lag] += 1
                self._begins[lag].appendleft(self._times[0])
                self._factors[lag].appendleft(log(length) - log(before))
            else:
                self._counts[lag] = 0
                self._begins[lag].clear()
                self._factors[lag].clear()
        self._directions.appendleft(direction)
        self._lengths.appendleft(length)
        if length > 0.0:
            self._share = length / (4.0 * self._motion)

    def _judged(self, proof: _Proof, time_ms: float) -> Alternation | None:
        """What the last steps, to `time_ms`, tell if they are `proof` of anything."""
        lags = _LAGS if self._counts[1] < _SAME else (1, 2)
        lag = next((lag for lag in lags if self._counts[lag] >= proof.steps), None)
        if lag is None or self._share <= proof.share:
            return None
        factors = list(islice(self._factors[lag], proof.steps))
        # Not the mean: the first steps of a run, and whatever else is new, begin with a few odd ones.
        middle = median(factors)
        rate = _factor(middle / lag)
        if rate < proof.rate or max(abs(factor - middle) for factor in factors) > log(proof.steady):
            return None
        rings = rate >= _RINGS and self._share > _LITTLE
        kind = GROWING if rate >= 1.0 - _EQUAL else RINGING if rings else DECAYING
        return Alternation(kind, rate, 2 * lag, self._begins[lag][proof.steps - 1], time_ms, self._share)

    def _tell(self, time_ms: float) -> None:
        """Judge the last steps; those that go on as before are one stretch."""
        found, before = self._judged(self._proof, time_ms), self._present
        if found is not None and before is not None and _alike(found, before):
            found = replace(found, rate=max(found.rate, before.rate), from_ms=before.from_ms)
        self._present = found
        if found is None:
            return
        goes_on = self.worst is not None and _alike(found, self.worst) and found.from_ms == self.worst.from_ms
        if goes_on or found.worse_than(self.worst):
            self.worst = found


def _alike(one: Alternation, other: Alternation) -> bool:
    return (one.kind, one.period_steps) == (other.kind, other.period_steps)


def _factor(logarithm: float) -> float:
    return exp(min(logarithm, _LARGEST))


def _numbers(found: Alternation) -> dict[str, Any]:
    """An alternation for a checkpoint, which has numbers only."""
    return {name: np.array(value) for name, value in (asdict(found) | {"kind": KINDS.index(found.kind)}).items()}


def _alternation(numbers: Mapping[str, Any]) -> Alternation:
    values = {name: value.item() for name, value in numbers.items()}
    return Alternation(**values | {"kind": KINDS[values["kind"]]})
