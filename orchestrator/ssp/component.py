"""A component of a system package as it is found: its element, its FMU, and what that declares."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..participants.fmu_description import Description, read_description
from ..participants.fmu_file import FmuFile
from ..participants.fmu_variables import fields, groups
from ..participants.participant import Port
from ..quoting import shortened
from .file import inside, named
from .unit_conversion import Measure

_FMU = "application/x-fmu-sharedlibrary"

#: The other ways to run an FMU, in words.
_OTHER = {"ModelExchange": "model exchange", "ScheduledExecution": "scheduled execution"}


class SystemComponent:
    """The component `element` in the folder `base` of the unpacked `package`; `unit` is its name in the scenario.

    `place` are the names of the systems that it is in, and its own. InputError if it is none that can be coupled:
    another kind of component, or no co-simulation FMU of FMI 2.0 or 3.0.
    """

    def __init__(self, element: Any, unit: str, place: tuple[str, ...], base: Path, package: Path) -> None:
        self.element, self.unit, self.place = element, unit, place
        self.base, self.package = base, package
        self.label = shortened(".".join(place))
        kind = element.get("type", _FMU)
        if kind != _FMU:
            raise InputError(f"component '{self.label}' is of the type {shortened(kind)}; only FMUs can be coupled")
        implementation = element.get("implementation", "any")
        if implementation in _OTHER:
            words = _OTHER[implementation]
            raise InputError(f"component '{self.label}' is to be run by {words}; only co-simulation is possible")
        path = inside(base, element.get("source"), f"the FMU of component '{self.label}'", package)
        #: The FMU, relative to the unpacked package.
        self.source = path.relative_to(package).as_posix()
        self.description = _described(path, f"component '{self.label}': {self.source}")
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.path = path

    @cached_property
    def connectors(self) -> dict[str, Any]:
        """The component's connectors by name."""
        return {item.get("name"): item for item in named(self.element, "ssd:Connectors/ssd:Connector")}

    def bindings(self) -> Iterator[Any]:
        """Its parameter bindings."""
        return named(self.element, "ssd:ParameterBindings/ssd:ParameterBinding")

    @cached_property
    def pins(self) -> dict[str, tuple[Port, int | None]]:
        """By the name of an input or output, the field that it is part of and its place in that; None for all of it."""
        pins: dict[str, tuple[Port, int | None]] = {}
        for causality in ("input", "output"):
            found = groups(self.description.modelVariables, (causality,))
            for name, field in fields(self.description, found, {}).items():
                # An array of FMI 3.0 is one variable.
                if name in self.variables and self.variables[name].shape:
                    pins[name] = field.port, None
                else:
                    pins |= {scalar: (field.port, place) for place, scalar in enumerate(field.port.elements)}
        return pins

    def measure(self, name: str) -> Measure | None:
        """The unit of the variable `name`, its own or that of its type, if it has one."""
        unit = self.variables[name].unit
        return None if unit is None else self.measures.get(unit, Measure(unit))

    def is_relative(self, name: str) -> bool:
        """Whether the variable `name` is a difference, of temperatures for instance, which has no offset."""
        return bool(self.variables[name].relativeQuantity)

    @cached_property
    def measures(self) -> dict[str, Measure]:
        """The units of measure that the FMU defines."""
        return dict(self._measures())

    def _measures(self) -> Iterator[tuple[str, Measure]]:
        for unit in self.description.unitDefinitions:
            base = unit.baseUnit
            names = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")
            yield unit.name, Measure.of(unit.name, base and {name: getattr(base, name) for name in names})


def _described(path: Path, what: str) -> Description:
    try:
        return read_description(FmuFile(path))
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
