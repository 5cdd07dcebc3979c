"""When a loop counts as converged: when every field that its sweeps start from does.

With the residual r = H(x) − x a field's criterion has the measures of preCICE: `absolute` |r| ≤ limit, `relative`
|r| ≤ limit |H(x)|, `residual_relative` |r| ≤ limit |r of the first sweep|. All norms are Euclidean over the field's
values. Of several measures given for one field any one is enough, so that `absolute` with `relative` is the usual pair
for a field that may vanish.

The residual of a field that a sweep starts from and that has no criterion of its own, relative to that field's
magnitude, is held to the strictest of the criteria given. Were it not judged, a loop would be accepted before anything
had arrived at the fields that are: under Jacobi a change needs as many sweeps as the loop has units to come round. A
field that is computed anew within a sweep, and from what the sweep started from, is consistent with that by itself.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from ..participants.participant import Values

#: Limits, relative to a field's magnitude, that one field's `absolute` or `residual_relative` criterion may mean for
#: another: never looser than three digits, never below rounding.
_LOOSEST, _STRICTEST = 1e-3, 1e-12


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

    def for_others(self, magnitude: float, first: float) -> float:
        """The residual over the magnitude that this criterion asks of other fields.

        `magnitude` is that of the field it is given for, `first` the norm of that field's first residual.
        """
        limits = [] if self.relative is None else [self.relative]
        for limit, scale in ((self.absolute, 1.0), (self.residual_relative, first)):
            if limit is not None:
                meant = limit * scale / magnitude if magnitude > 0.0 else _LOOSEST
                limits.append(min(max(meant, _STRICTEST), _LOOSEST))
        return max(limits)


class Convergence:
    """The history of the residuals of a loop's fields over the sweeps of one step.

    `criteria` are those given by name, `carried` the fields that a sweep starts from. Where no field of the loop has a
    criterion, three digits are asked of those. `exact` are fields that are no real numbers: their residual is 1
    where a value has changed, and has to vanish.
    """

    def __init__(
        self, criteria: Mapping[str, Criterion], carried: Collection[str] = (), exact: Collection[str] = ()
    ) -> None:
        self._exact = exact
        self._criteria = {name: criterion for name, criterion in criteria.items() if name not in exact}
        self._carried = [name for name in carried if name not in exact and name not in criteria]
        # Norms of the last values, and the largest of the step.
        self._norms: dict[str, float] = {}
        self._magnitudes: dict[str, float] = {}
        self.history: list[dict[str, float]] = []

    def judge(self, residuals: Mapping[str, Values], values: Mapping[str, Values]) -> bool:
        """Take the residuals and new values of a sweep, by field; whether every field meets its criterion."""
        first = not self.history
        self.history.append({name: _norm(residual) for name, residual in residuals.items()})
        for name, value in values.items():
            if name in self._exact:
                continue
            self._norms[name] = _norm(value)
            # What it was before the first sweep counts as well: a field on its way to zero has a magnitude.
            before = _norm(value - residuals[name]) if first else 0.0
            self._magnitudes[name] = max(self._magnitudes.get(name, 0.0), self._norms[name], before)
        return not self.open()

    def open(self) -> list[str]:
        """The fields that do not meet their criterion after the last sweep."""
        last, first = self.history[-1], self.history[0]
        named = {name: self._criteria[name] for name in last if name in self._criteria}
        limits = [criterion.for_others(self._magnitudes[name], first[name]) for name, criterion in named.items()]
        limit = min(limits, default=_LOOSEST)

        def met(name: str, residual: float) -> bool:
            if name in named:
                return named[name].met(residual, self._norms[name], first[name])
            if name in self._exact:
                return residual == 0.0
            return name not in self._carried or residual <= limit * self._magnitudes[name]

        return [name for name, residual in last.items() if not met(name, residual)]

    def growth(self, name: str) -> str:
        """In words, since when the residual of a field has not been smaller than it once was; empty if it falls."""
        norms = [sweep[name] for sweep in self.history]
        best = norms.index(min(norms))
        return "" if best == len(norms) - 1 else f", no improvement since sweep {best + 1}"

    @property
    def contraction_rate(self) -> float | None:
        """Factor by which the residual shrank per sweep, of the field where that was slowest; None for one sweep."""
        sweeps = len(self.history) - 1
        rates = [
            (norm / self.history[0][name]) ** (1.0 / sweeps)
            for name, norm in self.history[-1].items()
            if sweeps and self.history[0][name] > 0.0 and (name in self._criteria or name in self._carried)
        ]
        return max(rates, default=None)


def _norm(values: Values) -> float:
    return float(np.linalg.norm(values))
