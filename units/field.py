"""The values of one variable as an array: of the declared shape, and finite."""

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, IntArray, frozen
from .errors import InvalidInput
from .mesh import Mesh
from .variable import Location, Variable


def checked_field(variable: Variable, value: ArrayLike | str, mesh: Mesh, unit: str) -> FloatArray:
    """A read-only copy of `value` in the shape that `variable` of the `unit` of that name has on `mesh`.

    InvalidInput for what is no number, of another shape, or not finite.
    """
    what = _called(variable, unit)
    try:
        array = frozen(value)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{what} has to be real numbers: {error}") from None
    expected = variable.shape(mesh)
    if array.shape != expected:
        raise InvalidInput(f"{what} got shape {array.shape}, expected {expected}")
    check_finite(variable, array, mesh, unit)
    return array


def check_finite(variable: Variable, values: FloatArray, mesh: Mesh, unit: str, places: IntArray | None = None) -> None:
    """InvalidInput for values that are not finite: those at `places` of the flattened array, or the whole of it."""
    sound = np.isfinite(values)
    if sound.all():
        return
    place = int(np.flatnonzero(~sound)[0] if places is None else places[~sound][0])
    index = list(map(int, np.unravel_index(place, variable.shape(mesh) or (1,))))
    kind = variable.location.value if variable.location is not Location.GLOBAL else "index"
    raise InvalidInput(f"{_called(variable, unit)} is not finite at {kind} {index}")


def check_limit(variable: Variable, values: FloatArray, unit: str) -> None:
    """InvalidInput for values that are not above the limit of `variable`, if it has one."""
    if variable.above is not None and values.size and not values.min() > variable.above:
        raise InvalidInput(
            f"{_called(variable, unit)} is {values.min():.6g} somewhere; it has to be above {variable.above:g}"
        )


def _called(variable: Variable, unit: str) -> str:
    return f"{variable.causality.value} '{variable.name}' of unit '{unit}'"
