"""A system of connected FMUs, as all that is written for other tools sees it (`ssp`, `osp`, `container`)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from pathlib import Path
from shutil import copyfile
from typing import Any

import fmpy

from ...fmus.archive import put_in_place
from ...fmus.layout import scalar_names
from ..errors import InputError

Shape = tuple[int, ...]

#: The types of real numbers in FMI 2.0 and 3.0.
REAL = ("Real", "Float64", "Float32")


@dataclass(frozen=True)
class Value:
    """What the system gives to a variable before its initialisation, with the FMI type and unit of that.

    `texts` are the values of all elements in row-major order, of an array of `shape`.
    """

    name: str
    fmi_type: str
    texts: tuple[str, ...]
    unit: str | None = None
    shape: Shape = ()

    @property
    def text(self) -> str:
        """The value of a scalar."""
        (text,) = self.texts
        return text


@dataclass(frozen=True)
class Component:
    """An instance of the FMU in the file `fmu`.

    `inputs` and `outputs` are the shapes of its fields by name, () for scalars. `given` holds parameters and start
    values; one number for an array is that of all its elements.
    """

    name: str
    fmu: Path
    inputs: Mapping[str, Shape]
    outputs: Mapping[str, Shape]
    given: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def description(self) -> Any:
        """FMPy's model description."""
        return fmpy.read_model_description(str(self.fmu), validate=False)

    @property
    def fmi(self) -> int:
        """The version of FMI, 2 or 3."""
        return int(self.description.fmiVersion[0])

    @cached_property
    def variables(self) -> dict[str, Any]:
        """FMPy's variables by name."""
        return {variable.name: variable for variable in self.description.modelVariables}

    @cached_property
    def units(self) -> dict[str, Any]:
        """FMPy's base units of the units of measure that the FMU defines, by name."""
        definitions = self.description.unitDefinitions
        return {unit.name: unit.baseUnit for unit in definitions if unit.baseUnit is not None}

    def names(self, name: str, shape: Shape) -> Iterator[str]:
        """The variables that a field is: one array in FMI 3.0, else a variable for every scalar."""
        return iter((name,)) if name in self.variables else scalar_names(name, shape)

    def unit_of(self, name: str, shape: Shape) -> str | None:
        """Unit of measure of a field, if the FMU declares one."""
        unit: str | None = self.variables[next(self.names(name, shape))].unit
        return unit

    def values(self) -> Iterator[Value]:
        """All that is given, in the words of FMI; InputError for a variable that the FMU does not have."""
        for name, value in self.given.items():
            if name not in self.variables:
                raise InputError(f"the FMU {self.fmu.name} of '{self.name}' has no variable '{name}'; remove its value")
            variable = self.variables[name]
            shape = variable.shape or ()
            values = value if isinstance(value, list) else [value] * prod(shape)
            yield Value(name, variable.type, tuple(_text(variable, each) for each in values), variable.unit, shape)


@dataclass(frozen=True)
class Link:
    """An output that feeds an input, both of `shape`: as it is, or as factor · value + offset by `law`."""

    source: str
    output: str
    target: str
    input: str
    shape: Shape = ()
    law: tuple[float, float] | None = None

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"


@dataclass(frozen=True)
class System:
    """Components and their links; times in s.

    `step_s` is the communication step that the system was made for, and `order` the components in the order in which
    they were to be advanced, if not in their own: hints, since neither is a part of a system.
    """

    name: str
    components: tuple[Component, ...]
    links: tuple[Link, ...]
    stop_s: float
    step_s: float
    order: tuple[str, ...] = ()

    @cached_property
    def files(self) -> dict[Path, str]:
        """A file name for every FMU, unique among them: its own where that is free."""
        taken: dict[Path, str] = {}
        for component in self.components:
            if component.fmu not in taken:
                free = component.fmu.name not in taken.values()
                taken[component.fmu] = component.fmu.name if free else f"{component.name}-{component.fmu.name}"
        return taken

    def copy_fmus(self, folder: Path) -> None:
        """Put every FMU into `folder`, under its name among `files`."""
        for fmu, name in self.files.items():
            with put_in_place(folder / name) as part:
                copyfile(fmu, part)

    def component(self, name: str) -> Component:
        """The component `name`."""
        return next(component for component in self.components if component.name == name)

    def linked_inputs(self, component: Component) -> dict[str, Shape]:
        """The inputs of `component` that something feeds, in its own order."""
        fed = {link.input for link in self.links if link.target == component.name}
        return {name: shape for name, shape in component.inputs.items() if name in fed}

    def linked_outputs(self, component: Component) -> dict[str, Shape]:
        """The outputs of `component` that feed something, in its own order."""
        feeding = {link.output for link in self.links if link.source == component.name}
        return {name: shape for name, shape in component.outputs.items() if name in feeding}

    def pairs(self, link: Link) -> Iterator[tuple[str, str]]:
        """The variables that `link` connects, output and input: a pair for an array of FMI 3.0, else for every scalar.

        InputError where only one end is an array of FMI 3.0.
        """
        outputs = list(self.component(link.source).names(link.output, link.shape))
        inputs = list(self.component(link.target).names(link.input, link.shape))
        if len(outputs) != len(inputs) or (outputs == [link.output]) != (inputs == [link.input]):
            raise InputError(
                f"the connection {link} is of an array of FMI 3.0 at one end and of scalars at the other, which a "
                "system cannot express; take FMUs of one version of FMI for both"
            )
        return zip(outputs, inputs, strict=True)

    def require_plain(self, tool: str) -> None:
        """InputError for what `tool` does not know: FMI 3.0, and links that transform the fields that they carry."""
        for component in self.components:
            if component.fmi != 2:
                raise InputError(
                    f"the FMU {component.fmu.name} of '{component.name}' is of FMI 3.0, which cannot be written for "
                    f"{tool}; take one of FMI 2.0"
                )
        for link in self.links:
            if link.law is not None:
                raise InputError(
                    f"the connection {link} transforms its values, which cannot be written for {tool}; "
                    "give the source the unit of the target"
                )


def _text(variable: Any, value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    # Of a float, as many digits as it takes to read the same one back.
    return repr(float(value)) if variable.type in REAL else str(value)
