"""The values of an output at the last exchanges, and the polynomial through them."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from ..participants.participant import Values

_Sample = tuple[float, Values]


class History:
    """The last accepted values of one output with their times in s, at most `depth` of them."""

    def __init__(self, depth: int) -> None:
        # Newest first.
        self._samples: deque[_Sample] = deque(maxlen=depth)

    def add(self, time: float, values: Values) -> None:
        """Take the value at `time`, later than all before it."""
        self._samples.appendleft((time, values))

    def extrapolated(self, time: float, order: int) -> Values:
        """The polynomial of `order` through the newest values, at `time`; of lower order while there are too few."""
        samples = list(self._samples)[: order + 1]
        if len(samples) == 1:
            return samples[0][1]
        # Values of a run that diverges leave the numbers; whoever is given one that is not finite says so.
        with np.errstate(over="ignore", invalid="ignore"):
            terms = [weight * values for weight, (_, values) in zip(_weights(samples, time), samples, strict=True)]
            return sum(terms[1:], start=terms[0])

    def curvature(self) -> Values:
        """Second time derivative in 1/s² of the parabola through the last three values; zero while there are fewer."""
        if len(self._samples) < 3:
            return 0.0 * self._samples[0][1]
        (now, last), (earlier, middle), (first, oldest) = list(self._samples)[:3]
        rise, before = (last - middle) / (now - earlier), (middle - oldest) / (earlier - first)
        return 2.0 * (rise - before) / (now - first)

    def samples(self) -> list[_Sample]:
        """Times and values, newest first."""
        return list(self._samples)

    def resume(self, samples: Sequence[_Sample]) -> None:
        """Go on from what `samples` gave."""
        self._samples.clear()
        self._samples.extend(samples)


def _weights(samples: Sequence[_Sample], time: float) -> list[float]:
    """Lagrange's polynomials of the samples' times at `time`."""
    times = [moment for moment, _ in samples]
    weights = []
    for own in times:
        weight = 1.0
        for other in times:
            if other != own:
                weight *= (time - other) / (own - other)
        weights.append(weight)
    return weights
