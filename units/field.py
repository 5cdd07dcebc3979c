"""The values of one variable as an array: of the declared shape, and finite."""

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, frozen
from .errors import InvalidInput
from .mesh import Mesh
from .variable import Location, Variable


def checked_field(variable: Variable, value: ArrayLike | str, mesh: Mesh, unit: str) -> FloatArray:
    """A read-only copy of `value` in the shape that `variable` of the `unit` of that name has on `mesh`.

    InvalidInput for what is no number, of another shape, or not finite.
    """
    what = f"{variable.causality.value} '{variable.name}' of unit '{unit}'"
    try:
        array = frozen(value)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{what} takes real numbers, not this: {error}") from None
    expected = variable.shape(mesh)
    if array.shape != expected:
        raise InvalidInput(f"{what} got shape {array.shape}, expected {expected}")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(np.atleast_1d(array)))[0]
        place = variable.location.value if variable.location is not Location.GLOBAL else "index"
        raise InvalidInput(f"{what} is not finite at {place} {where.tolist()}")
    return array
