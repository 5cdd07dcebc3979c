"""When a loop counts as converged: when every field that its sweeps start from does.

With the residual r = H(x) − x a field's criterion has the measures of preCICE: `absolute` |r| ≤ limit, `relative`
|r| ≤ limit |H(x)|, `residual_relative` |r| ≤ limit |r of the first sweeps|. All norms are Euclidean over the field's
values. Of several measures given for one field any one is enough, so that `absolute` with `relative` is the usual pair
for a field that may vanish.

The residual of a field that a sweep starts from and that has no criterion of its own, relative to that field's
magnitude, is held to the strictest of the criteria given. Were it not judged, a loop would be accepted before anything
had arrived at the fields that are. A field that is computed anew within a sweep, and from what the sweep started from,
is consistent with that by itself.

Under Jacobi a change needs as many sweeps as the loop has units to come round: a *round*. What is a small change of one
field may be a large one of the next, behind a threshold, or where a field is a small signal on a large constant. So the
criteria have to be met in every sweep of a round, unless a sweep changes nothing at all; and the first residual of a
field is the largest of the first round, for in the first sweep nothing may have arrived at it.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import isfinite

from ..participants.participant import Values
from .norm import norm

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
        return isfinite(residual) and any(
            limit is not None and residual <= limit * scale
            for limit, scale in (
                (self.absolute, 1.0),
                (self.relative, value),
                (self.residual_relative, first),
            )
        )

    def for_others(self, magnitude: float, first: float) -> float:
        """The residual over the magnitude that this criterion asks of other fields.

        `magnitude` is that of the field it is given for, `first` the norm of that field's first residual. While that
        field has not moved at all, a limit relative to its residual is one relative to the magnitude.
        """
        limits = [] if self.relative is None else [self.relative]
        for limit, scale in ((self.absolute, 1.0), (self.residual_relative, first or magnitude)):
            if limit is not None:
                meant = limit * scale / magnitude if magnitude > 0.0 else _LOOSEST
                limits.append(min(max(meant, _STRICTEST), _LOOSEST))
        return max(limits)


class Convergence:
    """The history of the residuals of a loop's fields over the sweeps of one step.

    `criteria` are those given by name, `carried` the fields that a sweep starts from. Where no field of the loop has a
    criterion, three digits are asked of those. `exact` are fields that are no real numbers: their residual is 1
    where a value has changed, and has to vanish. `round_sweeps` is the number of sweeps in a round.
    """

    def __init__(
        self,
        criteria: Mapping[str, Criterion],
        carried: Collection[str] = (),
        exact: Collection[str] = (),
        round_sweeps: int = 1,
    ) -> None:
        self._round = round_sweeps
        self._exact = exact
        self._criteria = {name: criterion for name, criterion in criteria.items() if name not in exact}
        self._carried = [name for name in carried if name not in exact and name not in criteria]
        # Norms of the last values, and the largest of the step.
        self._norms: dict[str, float] = {}
        self._magnitudes: dict[str, float] = {}
        # By sweep, the fields that did not meet their criterion in it.
        self._missed: list[list[str]] = []
        self.history: list[dict[str, float]] = []

    def judge(self, residuals: Mapping[str, Values], values: Mapping[str, Values]) -> bool:
        """Take the residuals and new values of a sweep, by field; whether the loop has converged with it."""
        first = not self.history
        self.history.append({name: norm(residual) for name, residual in residuals.items()})
        for name, value in values.items():
            if name in self._exact:
                continue
            self._norms[name] = norm(value)
            # What it was before the first sweep counts as well: a field on its way to zero has a magnitude.
            before = norm(value - residuals[name]) if first else 0.0
            self._magnitudes[name] = max(self._magnitudes.get(name, 0.0), self._norms[name], before)
        self._missed.append(self._missing())
        # Where nothing has changed, nothing is on its way either.
        rests = not any(self.history[-1].values())
        return rests or (len(self._missed) >= self._round and not self.open())

    def open(self) -> list[str]:
        """The fields that have not met their criterion in every sweep of the last round."""
        return list(dict.fromkeys(name for missed in self._missed[-self._round :] for name in missed))

    def _missing(self) -> list[str]:
        """The fields that do not meet their criterion after the last sweep."""
        last = self.history[-1]
        # The largest of the first round: before, nothing may have arrived at a field.
        first = {name: max(sweep[name] for sweep in self.history[: self._round]) for name in last}
        named = {name: self._criteria[name] for name in last if name in self._criteria}
        limits = [criterion.for_others(self._magnitudes[name], first[name]) for name, criterion in named.items()]
        limit = min(limits, default=_LOOSEST)

        def met(name: str, residual: float) -> bool:
            if name in named:
                return named[name].met(residual, self._norms[name], first[name])
            if name in self._exact:
                return residual == 0.0
            return name not in self._carried or Criterion(relative=limit).met(residual, self._magnitudes[name], 0.0)

        return [name for name, residual in last.items() if not met(name, residual)]

    def growth(self, name: str) -> str:
        """In words, since when the residual of a field has not been smaller than it once was; empty if it falls."""
        norms = [sweep[name] for sweep in self.history]
        best = norms.index(min(norms))
        return "" if best == len(norms) - 1 else f", no improvement since sweep {best + 1}"

    @property
    def contraction_rate(self) -> float | None:
        """Factor by which the residual shrank per sweep, of the field where that was slowest; None for one sweep.

        It is taken from the largest residuals of the first and of the last round: under Jacobi fields take turns.
        """
        sweeps = len(self.history)
        window = min(self._round, sweeps - 1)
        rates = []
        for name in self.history[0] if window else ():
            first, last = (
                max(sweep[name] for sweep in part) for part in (self.history[:window], self.history[-window:])
            )
            if first > 0.0 and (name in self._criteria or name in self._carried):
                rates.append((last / first) ** (1.0 / (sweeps - window)))
        return max(rates, default=None)
