"""What a unit shows the outside: one declaration that the FMU, the native participant and the docs derive from."""

from collections.abc import Iterator
from dataclasses import MISSING, dataclass, field, fields
from enum import Enum
from typing import Any

import numpy as np

from .errors import InvalidInput
from .mesh import Mesh

Scalar = float | int | bool | str

#: Limits of a potential in mV that could be meant: a hundred times what any cell reaches.
VOLTAGE: dict[str, float] = {"at_least": -1e4, "below": 1e4}


class Causality(Enum):
    """How a variable crosses the boundary of a unit (FMI 2.0.4, section 2.2.7)."""

    PARAMETER = "parameter"
    INPUT = "input"
    OUTPUT = "output"
    CALCULATED_PARAMETER = "calculatedParameter"

    def __str__(self) -> str:
        """For a person, with its article."""
        return f"{'an' if self.value[0] in 'aeiou' else 'a'} {self.value.replace('P', ' p')}"


class Location(Enum):
    """Where on the shared mesh the values of a field sit."""

    GLOBAL = "global"
    NODE = "node"
    ELEMENT = "element"


class Record(Enum):
    """What a time series keeps of an output: its value (scalars), its value at the probes, or nothing."""

    NOTHING = "nothing"
    VALUE = "value"
    PROBES = "probes"


class Refinement(Enum):
    """How a parameter makes the numerical error of its unit smaller, told to those who know no physics."""

    #: The longest internal time step: the error falls as it is divided.
    STEP = "step"
    #: A count of nested refinements of a mesh: the error falls as it is raised, each level halves h.
    MESH = "mesh"
    #: A tolerance of an internal solver: the error falls as it is divided.
    TOLERANCE = "tolerance"


@dataclass(frozen=True)
class Variable:
    """One variable of a unit.

    `unit` is the unit of measure ("mV"; "1" for a pure number). `depends_on` names the inputs that an output follows;
    `pointwise` says that its value at a place follows those inputs at this place only. `fixed` variables keep their
    value after initialisation. `needs` names a parameter that must differ from zero for the input or output to matter.
    What an input starts with is a `stand_in` where only another unit knows its value: it lets the unit run by itself.
    `recorded_with` names boundaries of the mesh without which there is nothing to record, the value being always 0.
    `missing` is the value at places that have none yet; `mean_record` says of a field what `record` says of its mean.
    `refines` says of a number that it decides the unit's numerical error, and how; it needs a lower limit.
    """

    name: str
    causality: Causality
    unit: str
    description: str
    location: Location = Location.GLOBAL
    components: int = 1
    start: Scalar = 0.0
    fixed: bool = False
    stand_in: bool = False
    depends_on: tuple[str, ...] = ()
    pointwise: bool = False
    needs: str | None = None
    record: Record = Record.NOTHING
    recorded_with: tuple[str, ...] = ()
    mean_record: Record = Record.NOTHING
    missing: float | None = None
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()
    refines: Refinement | None = None

    def shape(self, mesh: Mesh) -> tuple[int, ...]:
        """Array shape on `mesh`: () for a scalar, (places,) or (places, components) for a field."""
        if self.location is Location.GLOBAL:
            places: tuple[int, ...] = ()
        else:
            places = (mesh.nodes if self.location is Location.NODE else mesh.elements,)
        return places if self.components == 1 else (*places, self.components)

    def recorded_on(self, mesh: Mesh) -> Record:
        """What a time series keeps of it on `mesh`."""
        return self.record if set(self.recorded_with) <= set(mesh.boundaries) else Record.NOTHING

    def checked(self, value: Any) -> Scalar:
        """`value` as this parameter's type; InvalidInput names the parameter, the value and what is allowed."""
        if isinstance(self.start, str):
            if value not in self.choices:
                raise InvalidInput(f"parameter '{self.name}' is {value!r}; choose one of: {', '.join(self.choices)}")
            return str(value)
        if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
            raise InvalidInput(f"parameter '{self.name}' is {value!r}; expected a {self._kind} {self._range()}")
        number = float(value)
        if (
            (isinstance(self.start, int) and not number.is_integer())
            or not np.isfinite(number)
            or (self.above is not None and not number > self.above)
            or (self.at_least is not None and not number >= self.at_least)
            or (self.below is not None and not number < self.below)
        ):
            raise InvalidInput(f"parameter '{self.name}' is {value!r}; expected a {self._kind} {self._range()}")
        return int(number) if isinstance(self.start, int) else number

    @property
    def _kind(self) -> str:
        return "whole number" if isinstance(self.start, int) else "finite number"

    def _range(self) -> str:
        bounds = [
            f"{sign} {bound:g}"
            for sign, bound in ((">", self.above), (">=", self.at_least), ("<", self.below))
            if bound is not None
        ]
        unit = "" if self.unit == "1" else f"in {self.unit}"
        return " ".join([unit, " and ".join(bounds)]).strip() or "(any sign)"


def parameter(default: Scalar, unit: str, description: str, **limits: Any) -> Any:
    """A dataclass field that is also an FMI parameter; `limits` are those of :class:`Variable`."""
    return field(default=default, metadata={"unit": unit, "description": description, **limits})


def parameters_of(group: type) -> Iterator[Variable]:
    """The FMI parameters that the frozen dataclass `group` declares by :func:`parameter`."""
    for item in fields(group):
        if item.default is MISSING:
            raise TypeError(f"{group.__name__}.{item.name} has no default")
        yield Variable(item.name, Causality.PARAMETER, start=item.default, fixed=True, **item.metadata)
