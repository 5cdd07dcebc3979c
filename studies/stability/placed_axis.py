"""Where the values of a varied key stand on the axis of a map, and where the boxes around them end."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, log, sqrt
from typing import Any

import numpy as np

from ..point import value_text

#: An axis over less than this ratio of its values is linear, whatever their distances.
_RATIO = 8.0


@dataclass(frozen=True)
class PlacedAxis:
    """`values` in the order of their `places`, which ascend; `edges`, one more, are those of the boxes around them.

    The places of numbers are the numbers; those of other values count from 0, one apart. The axis of numbers
    `is_logarithmic` where they are positive, far apart and rather a geometric series than an arithmetic one.
    """

    values: Sequence[Any]
    places: Sequence[float]
    edges: Sequence[float]
    is_number: bool
    is_logarithmic: bool = False

    @property
    def labels(self) -> list[str]:
        """The values for a person."""
        if not self.is_number:
            return [value_text(value) for value in self.values]
        return [number_text(place) for place in self.places]

    def number(self, value: Any) -> int | None:
        """The number of the box of a value; None of one that is not of the grid."""
        for number, each in enumerate(self.values):
            if each == value and isinstance(each, bool) == isinstance(value, bool):
                return number
        return None

    def place(self, value: Any) -> float | None:
        """The place of a value, of a number too if it is not of the grid; None where it has none."""
        if self.is_number:
            return float(value) if _is_number(value) else None
        number = self.number(value)
        return None if number is None else self.places[number]

    def part(self, low: float, high: float, part: float) -> float:
        """The place between two others that is so large a part of the way, as the axis measures it."""
        return float(low * (high / low) ** part) if self.is_logarithmic else low + part * (high - low)

    @property
    def parts(self) -> list[float]:
        """The places as parts of the axis' length."""
        measured = [
            log(each) if self.is_logarithmic else each for each in (self.edges[0], *self.places, self.edges[-1])
        ]
        first, last = measured[0], measured[-1]
        return [(each - first) / (last - first) for each in measured[1:-1]]

    def box(self, place: float) -> tuple[float, float]:
        """The edges of the box in which a place is; of the nearest one for a place beside all boxes."""
        number = int(np.clip(np.searchsorted(self.edges, place, side="right") - 1, 0, len(self.places) - 1))
        return self.edges[number], self.edges[number + 1]


def placed_axis(values: Sequence[Any], from_the_end: bool = False) -> PlacedAxis:
    """An axis over the values of a grid; what are no numbers stand in their order or `from_the_end`."""
    if not values or not all(map(_is_number, values)):
        ordered = list(reversed(values)) if from_the_end else list(values)
        count = len(ordered)
        return PlacedAxis(ordered, [float(n) for n in range(count)], [n - 0.5 for n in range(count + 1)], False)
    ordered = sorted(set(values))
    places = [float(value) for value in ordered]
    is_logarithmic = _is_geometric(places)
    return PlacedAxis(ordered, places, _edges(places, is_logarithmic), True, is_logarithmic)


def number_text(value: float) -> str:
    """A number at an axis."""
    return f"{value:.4g}".replace("-", "−")


# --- inside -----------------------------------------------------------------------------------------------------------


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)


def _is_geometric(places: Sequence[float]) -> bool:
    if places[0] <= 0.0 or places[-1] < _RATIO * places[0]:
        return False
    ratios = np.diff(np.log(places))
    distances = np.diff(places)
    return bool(np.std(ratios) / np.mean(ratios) <= np.std(distances) / np.mean(distances))


def _edges(places: Sequence[float], is_logarithmic: bool) -> list[float]:
    """Midway between neighbours, and as far beyond the first and last."""
    if len(places) == 1:
        half = 0.5 * abs(places[0]) or 0.5
        return [places[0] - half, places[0] + half]
    if is_logarithmic:
        inner = [sqrt(low) * sqrt(high) for low, high in pairwise(places)]
        return [places[0] ** 2 / inner[0], *inner, places[-1] / inner[-1] * places[-1]]
    inner = [0.5 * (low + high) for low, high in pairwise(places)]
    first = 2.0 * places[0] - inner[0]
    # A box of lengths does not reach to those below nothing.
    return [max(first, 0.0) if places[0] > 0.0 else first, *inner, 2.0 * places[-1] - inner[-1]]
