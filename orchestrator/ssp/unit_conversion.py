"""From one unit of measure to another, by their definitions in SI base units (FMI 2.0.4, section 2.2.2; SSP as well).

A value v in a unit is factor · v + offset in base units.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Any

from ..coupling.connections import Law
from ..errors import InputError

_EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Measure:
    """A unit of measure, as far as it is known: its name, exponents of the base units, factor and offset."""

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0

    @classmethod
    def of(cls, name: str, base: Any) -> "Measure":
        """From the attributes of a BaseUnit: strings by name, or None where the unit is not defined."""
        if base is None:
            return cls(name)
        try:
            exponents = tuple(int(base.get(key, 0)) for key in _EXPONENTS)
            factor, offset = float(base.get("factor", 1.0)), float(base.get("offset", 0.0))
        except (TypeError, ValueError):
            return cls(name)
        # What has no inverse measures nothing.
        return cls(name, exponents, factor, offset) if isfinite(factor * offset) and factor != 0.0 else cls(name)

    @classmethod
    def of_element(cls, unit: Any) -> "Measure":
        """From a Unit of SSP 1.0."""
        return cls.of(unit.get("name"), next(unit.iterfind("{*}BaseUnit"), None))


def conversion(source: Measure, target: Measure, relative: bool = False) -> Law | None:
    """What makes a value in `target` of one in `source`; None where there is nothing to do.

    `relative` quantities, differences of temperature, have no offsets. InputError if the two measure different things,
    or are not defined.
    """
    # Some tools write [m] for m where they do not define it.
    if source.name.strip("[]") == target.name.strip("[]") and None in (source.exponents, target.exponents):
        return None
    if source.name == target.name:
        return None
    for unit in (source, target):
        if unit.exponents is None:
            raise InputError(
                f"the unit of measure '{unit.name}' is not defined, so that {source.name} cannot be converted to "
                f"{target.name}; define it, or give both ends the same"
            )
    if source.exponents != target.exponents:
        raise InputError(f"{source.name} and {target.name} measure different things; correct one of the units")
    offset = 0.0 if relative else (source.offset - target.offset) / target.factor
    return Law(source.factor / target.factor, offset)


def chained(first: Law | None, second: Law | None) -> Law | None:
    """Both laws, one after the other."""
    if first is None or second is None:
        return first or second
    return Law(second.factor * first.factor, second.factor * first.offset + second.offset)
