"""The value references of a unit's variables in FMI 3.0, where a field is one variable whatever its size."""

from dataclasses import dataclass
from math import prod

from ...units.mesh import Mesh
from ...units.unit import Unit
from ...units.variable import Variable

#: Value reference of the independent variable, time in s, which FMI 3.0 wants declared (section 2.4.7.4).
TIME = 0

#: FMI 3.0 type of a variable, by the Python type of its start value.
FMI_TYPES: dict[type, str] = {float: "Float64", int: "Int32", str: "String"}


@dataclass(frozen=True)
class Entry:
    """A variable, its shape on the mesh (() for a scalar), and its value reference."""

    variable: Variable
    shape: tuple[int, ...]
    reference: int

    @property
    def size(self) -> int:
        """Number of values, in row-major order of `shape` (FMI 3.0, section 2.2.7.1)."""
        return prod(self.shape)

    @property
    def fmi_type(self) -> str:
        """Float64, Int32 or String."""
        return FMI_TYPES[type(self.variable.start)]


def layout(unit: type[Unit], mesh: Mesh) -> tuple[Entry, ...]:
    """All variables of `unit` on `mesh` in the order of declaration; value references count from the time's."""
    return tuple(
        Entry(variable, variable.shape(mesh), reference)
        for reference, variable in enumerate(unit.variables(), start=TIME + 1)
    )
