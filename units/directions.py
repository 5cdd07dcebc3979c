"""Directions that vary from element to element: fibre a₀ and sheet s₀, given once at initialisation."""

import numpy as np

from .arrays import FloatArray, frozen
from .errors import InvalidInput
from .variable import Causality, Location, Variable

#: A unit vector's components where they are alike: one number is then what a whole field starts with, in FMI as well.
_ALIKE = 3.0**-0.5

FIBER_INPUT = Variable(
    "fiber",
    Causality.INPUT,
    "1",
    "fibre direction, a unit vector",
    Location.ELEMENT,
    components=3,
    fixed=True,
    start=_ALIKE,
    stand_in=True,
)
SHEET_INPUT = Variable(
    "sheet",
    Causality.INPUT,
    "1",
    "sheet direction, a unit vector normal to the fibre",
    Location.ELEMENT,
    components=3,
    fixed=True,
    start=_ALIKE,
    stand_in=True,
)

#: Deviation from a unit vector, or from a right angle, that is taken for rounding in another tool.
_TOLERANCE = 1e-6


def given_sheet(sheet: FloatArray, fiber: FloatArray) -> FloatArray:
    """`sheet`, shape (elements, 3); as long as nobody has given it, directions normal to the unit vectors `fiber`."""
    if not (sheet == SHEET_INPUT.start).all():
        return sheet
    normal = np.cross(fiber, np.eye(3)[np.abs(fiber).argmin(axis=1)])
    return frozen(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def check_directions(name: str, directions: FloatArray, normal_to: FloatArray | None = None) -> None:
    """Raise InvalidInput unless `directions`, shape (elements, 3), are unit vectors (normal to `normal_to`)."""
    off = np.abs(np.linalg.norm(directions, axis=1) - 1.0)
    if off.max() > _TOLERANCE:
        where = int(off.argmax())
        raise InvalidInput(
            f"input '{name}' is not a unit vector in element {where}: {directions[where].tolist()}; "
            f"connect it to the output '{name}' of a fibre generator"
        )
    if normal_to is not None:
        cosine = np.abs(np.einsum("ei,ei->e", directions, normal_to))
        if cosine.max() > _TOLERANCE:
            where = int(cosine.argmax())
            raise InvalidInput(
                f"input '{name}' is not normal to the fibre in element {where} (cosine {cosine[where]:.3g}); "
                "take both from the same fibre generator"
            )
