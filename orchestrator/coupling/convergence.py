"""When a field counts as converged (measures as in preCICE).

With the residual r = H(x) − x: `absolute` |r| ≤ limit, `relative` |r| ≤ limit |H(x)|, `residual_relative`
|r| ≤ limit |r of the first sweep|. All norms are Euclidean over the field's values. Of several measures given for one
field any one is enough, so that `absolute` with `relative` is the usual pair for a field that may vanish.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..participants.participant import Values


@dataclass(frozen=True)
class Criterion:
    """Limits of one field's residual; None where a measure is not used."""

    absolute: float | None = None
    relative: float | None = None
    residual_relative: float | None = None

    def met(self, residual: float, value: float, first: float) -> bool:
        """Whether a residual of this norm is small enough, next to the norms of the value and of the first residual."""
        return any(
            limit is not None and residual <= limit * scale
            for limit, scale in (
                (self.absolute, 1.0),
                (self.relative, value),
                (self.residual_relative, first),
            )
        )


class Convergence:
    """The history of the residuals of several fields over the sweeps of one step."""

    def __init__(self, criteria: Mapping[str, Criterion]) -> None:
        self._criteria = criteria
        self.history: list[dict[str, float]] = []

    def judge(self, residuals: Mapping[str, Values], values: Mapping[str, Values]) -> bool:
        """Take the residuals and new values of a sweep; whether every field that has a criterion meets it."""
        self.history.append({name: float(np.linalg.norm(residual)) for name, residual in residuals.items()})
        return not self.open(values)

    def open(self, values: Mapping[str, Values]) -> list[str]:
        """The fields that do not meet their criterion after the last sweep."""
        last, first = self.history[-1], self.history[0]
        return [
            name
            for name, criterion in self._criteria.items()
            if not criterion.met(last[name], float(np.linalg.norm(values[name])), first[name])
        ]

    def growth(self, name: str) -> str:
        """In words, since when the residual of a field has not been smaller than it once was; empty if it falls."""
        norms = [sweep[name] for sweep in self.history]
        best = norms.index(min(norms))
        return "" if best == len(norms) - 1 else f", not below its value of sweep {best + 1} since"

    @property
    def contraction_rate(self) -> float | None:
        """Factor by which the residual shrank per sweep, of the field where that was slowest; None for one sweep."""
        sweeps = len(self.history) - 1
        rates = [
            (self.history[-1][name] / self.history[0][name]) ** (1.0 / sweeps)
            for name in self._criteria
            if sweeps and self.history[0][name] > 0.0
        ]
        return max(rates, default=None)
