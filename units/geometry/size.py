"""Element sizes that a geometry can be meshed with: one that makes millions of elements is a slip of units."""

import math

from ..errors import InvalidInput


def check_size(size_mm: float, finest_mm: float, coarsest_mm: float, coefficient: float, power: int) -> None:
    """Refuse a size outside of its range.

    About `coefficient` / size^`power` elements come of a size: the measure of the geometry in mm^`power` times the
    elements per cube of the size.

    Raises
    ------
    InvalidInput
        With the range and, for small sizes, the number of elements.
    """
    if math.isfinite(size_mm) and finest_mm <= size_mm <= coarsest_mm:
        return
    many = ""
    if 0.0 < size_mm < finest_mm:
        # By logarithms, for sizes whose power is no number any more.
        digits = math.log10(coefficient) - power * math.log10(size_mm)
        many = f", which makes about {10 ** (digits % 1):.1f}e{math.floor(digits)} elements"
    raise InvalidInput(
        f"mesh_size_mm is {size_mm:g}{many}; expected {finest_mm:.3g} to {coarsest_mm:g} mm: finer meshes do not fit "
        "into a computer, and coarser elements are thicker than the thinnest part"
    )
