"""An axis of a map: the values of a varied key, along which something may lie between two of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from ...orchestrator.participants.participant import Values

#: Values that span more than this factor are divided by their ratios.
_DECADE = 10.0

#: Digits of a value between those of the study: a millionth of it, and short enough to be read.
_DIGITS = 6


@dataclass(frozen=True)
class Axis:
    """The `values` of the varied `key`, in the order of the study."""

    key: str
    values: Sequence[Any]

    @property
    def is_numeric(self) -> bool:
        """Whether all values are numbers, so that there is something between them."""
        return all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)

    @property
    def is_geometric(self) -> bool:
        """Whether ratios count, and not differences: of positive values over more than a decade."""
        return self.is_numeric and min(self.values) > 0.0 and max(self.values) > _DECADE * min(self.values)

    @property
    def rising(self) -> list[Any]:
        """The values of a numeric axis from the smallest on, each once."""
        return sorted(set(self.values))

    def between(self, low: float, high: float) -> float:
        """The value in the middle, in a few digits."""
        middle = sqrt(low * high) if self.is_geometric else 0.5 * (low + high)
        return float(f"{middle:.{_DIGITS}g}")

    def place(self, value: float) -> float:
        """Where a value lies on the axis as it is drawn."""
        return float(np.log(value)) if self.is_geometric else value

    def refined(self, parts: int) -> Values:
        """The rising values with so many steps from each to the next, shape ((values − 1) · parts + 1,)."""
        rising = np.array(self.rising, float)
        at = np.linspace(0.0, len(rising) - 1.0, (len(rising) - 1) * parts + 1)
        return self._interpolated(rising, at)

    def spread(self, count: int) -> Values:
        """So many values at least over the whole axis, those of the study among them."""
        parts = max(1, -(-(count - 1) // max(len(self.rising) - 1, 1)))
        return self.refined(parts)

    def _interpolated(self, rising: Values, at: Values) -> Values:
        numbers = np.arange(len(rising), dtype=float)
        found = np.exp(np.interp(at, numbers, np.log(rising))) if self.is_geometric else np.interp(at, numbers, rising)
        # Those of the study to the last bit.
        whole = at == np.round(at)
        return np.where(whole, rising[np.round(at).astype(int)], found)
