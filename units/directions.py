"""Directions that vary from element to element: fibre a₀ and sheet s₀, given once at initialisation."""

import numpy as np

from .arrays import FloatArray
from .errors import InvalidInput
from .variable import Causality, Location, Variable

FIBER_INPUT = Variable(
    "fiber",
    Causality.INPUT,
    "1",
    "fibre direction, a unit vector",
    Location.ELEMENT,
    components=3,
    fixed=True,
    stand_in=(1.0, 0.0, 0.0),
)
SHEET_INPUT = Variable(
    "sheet",
    Causality.INPUT,
    "1",
    "sheet direction, a unit vector normal to the fibre",
    Location.ELEMENT,
    components=3,
    fixed=True,
    stand_in=(0.0, 1.0, 0.0),
)

#: Deviation from a unit vector, or from a right angle, that is taken for rounding in another tool.
_TOLERANCE = 1e-6


def check_directions(name: str, directions: FloatArray, normal_to: FloatArray | None = None) -> None:
    """Raise InvalidInput unless `directions`, shape (elements, 3), are unit vectors (normal to `normal_to`)."""
    off = np.abs(np.linalg.norm(directions, axis=1) - 1.0)
    if off.max() > _TOLERANCE:
        where = int(off.argmax())
        raise InvalidInput(
            f"input '{name}' is no unit vector in element {where}: {directions[where].tolist()}; "
            f"connect it to the output '{name}' of a fibre generator"
        )
    if normal_to is not None:
        cosine = np.abs(np.einsum("ei,ei->e", directions, normal_to))
        if cosine.max() > _TOLERANCE:
            where = int(cosine.argmax())
            raise InvalidInput(
                f"input '{name}' is not normal to the fibre in element {where} (cosine {cosine[where]:.3g})"
            )
