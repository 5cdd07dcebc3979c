"""Units of measure in a package: every file defines those that it names."""

from collections.abc import Iterable
from typing import Any

from ...errors import InputError
from ...systems.system import Component
from ..vocabulary import SSC

_BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def definitions(maker: Any, used: Iterable[tuple[Component, set[str | None]]]) -> list[Any]:
    """The element of all unit definitions, in the namespace of `maker`; none if there is nothing to define.

    InputError if two FMUs mean different things by the same name.
    """
    bases: dict[str, dict[str, str]] = {}
    for component, names in used:
        for name in names & component.units.keys():
            base = _base(component.units[str(name)])
            if bases.setdefault(str(name), base) != base:
                raise InputError(
                    f"the FMU {component.fmu.name} of '{component.name}' defines the unit of measure '{name}' "
                    "differently from another FMU; a package can have only one definition"
                )
    elements = [SSC.Unit({"name": name}, SSC.BaseUnit(base)) for name, base in sorted(bases.items())]
    return [maker.Units(*elements)] if elements else []


def _base(unit: Any) -> dict[str, str]:
    exponents = {key: str(getattr(unit, key)) for key in _BASE_UNITS if getattr(unit, key)}
    return exponents | {"factor": repr(float(unit.factor)), "offset": repr(float(unit.offset))}


def measured(component: Component, unit: str | None) -> dict[str, str]:
    """The attribute for a unit that the FMU defines; one that it only names stays with the FMU."""
    return {"unit": unit} if unit in component.units else {}
