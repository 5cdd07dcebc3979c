"""The order of accuracy, as it is observed."""

from collections.abc import Mapping, Sequence
from math import isfinite, log
from typing import Any

#: Points that a slope is taken from at least: two always lie on a line.
_LEAST = 3

#: The last part of a key that counts nested refinements, each of which halves the size of the mesh.
_HALVES = "refine"


def step_of(settings: Mapping[str, Any]) -> float | None:
    """The one varied number of a point, of which the error may be a power; None where there is none or more than one.

    A count of refinements becomes the mesh size relative to the mesh that is not refined.
    """
    numbers = {
        key: value for key, value in settings.items() if isinstance(value, int | float) and not isinstance(value, bool)
    }
    if len(settings) != 1 or len(numbers) != 1:
        return None
    ((key, value),) = numbers.items()
    if key.rpartition(".")[2] == _HALVES:
        return float(0.5**value)
    return float(value) if value > 0.0 else None


def observed_order(steps: Sequence[float | None], errors: Sequence[float], above: float = 0.0) -> float | None:
    """The slope of the logarithm of the error over that of the step, by least squares.

    None for less than three errors that are finite and `above` what the reference errs by itself.
    """
    pairs = [
        (log(step), log(error))
        for step, error in zip(steps, errors, strict=True)
        if step is not None and isfinite(error) and error > max(above, 0.0)
    ]
    places = {place for place, _ in pairs}
    if len(places) < _LEAST:
        return None
    middle = sum(place for place, _ in pairs) / len(pairs)
    height = sum(value for _, value in pairs) / len(pairs)
    spread = sum((place - middle) ** 2 for place, _ in pairs)
    return sum((place - middle) * (value - height) for place, value in pairs) / spread
