"""Mean and maximum of every field that moves, as scalars: what a tool plots by itself.

They follow from the field's own declaration, and are computed when somebody reads them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from .arrays import FloatArray, frozen
from .variable import Causality, Location, Record, Variable


class Kind(Enum):
    """Which number is drawn from a field; the value is the end of its name."""

    MEAN = "mean"
    MAX = "max"


@dataclass(frozen=True, kw_only=True)
class Statistic(Variable):
    """A scalar output drawn from the field `source`: over its places, not weighted; of vectors, of their magnitude.

    Places whose value is the field's `missing` one do not count. Where no other is left, the number is that too.
    """

    source: Variable
    kind: Kind

    def __call__(self, values: FloatArray) -> FloatArray:
        """The number, shape (), of the field's `values`, shape (places,) or (places, components)."""
        numbers = self._numbers(values)
        if self.source.missing is not None:
            numbers = numbers[numbers != self.source.missing]
            if not numbers.size:
                return frozen(self.source.missing)
        return frozen(numbers.mean() if self.kind is Kind.MEAN else numbers.max())

    def gradient(self, values: FloatArray) -> FloatArray:
        """Its derivative by every one of the field's `values`, in their shape.

        A maximum follows the first place that holds it; a vector of no length has no direction, and counts as at rest.
        """
        numbers = self._numbers(values)
        counted = np.ones(numbers.shape, dtype=bool) if self.source.missing is None else numbers != self.source.missing
        slopes = np.zeros_like(numbers)
        if self.kind is Kind.MEAN and counted.any():
            slopes[counted] = 1.0 / np.count_nonzero(counted)
        elif counted.any():
            slopes[np.where(counted, numbers, -np.inf).argmax()] = 1.0
        if self.source.components == 1:
            return slopes
        lengths = np.where(numbers > 0.0, numbers, 1.0)
        return np.asarray((slopes / lengths)[:, None] * values)

    def _numbers(self, values: FloatArray) -> FloatArray:
        return values if self.source.components == 1 else np.linalg.norm(values, axis=1)


def statistics(fields: tuple[Variable, ...]) -> Iterator[Statistic]:
    """The scalars of all outputs among `fields` that lie on the mesh and are not fixed."""
    for field in fields:
        if field.causality is Causality.OUTPUT and field.location is not Location.GLOBAL and not field.fixed:
            yield from (_statistic(field, kind) for kind in Kind)


def _statistic(field: Variable, kind: Kind) -> Statistic:
    what = field.name if field.components == 1 else f"the magnitude of {field.name}"
    missing = "" if field.missing is None else f" that have a value; {field.missing:g} as long as none has"
    return Statistic(
        name=f"{field.name}_{kind.value}",
        causality=Causality.OUTPUT,
        unit=field.unit,
        description=f"{'mean' if kind is Kind.MEAN else 'maximum'} of {what} over the {field.location.value}s{missing}",
        depends_on=field.depends_on,
        needs=field.needs,
        record=field.mean_record if kind is Kind.MEAN else Record.NOTHING,
        source=field,
        kind=kind,
    )
