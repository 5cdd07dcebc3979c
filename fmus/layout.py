"""Where a unit's variables sit among the value references of its FMU.

FMI 3.0 has a reference for every variable, whatever its shape. FMI 2.0 has scalars only: there a variable is a run of
consecutive references, one for each of its values.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod

from ..units.mesh import Mesh
from ..units.unit import Unit
from ..units.variable import Causality, Variable

#: Types of FMI 2.0 and 3.0, by the Python type of a variable's start value.
_TYPES: dict[int, dict[type, str]] = {
    2: {float: "Real", int: "Integer", str: "String"},
    3: {float: "Float64", int: "Int32", str: "String"},
}


@dataclass(frozen=True)
class Run:
    """A variable with its shape on the mesh, () for a scalar, and what its values are known by.

    `reference` is its value reference in FMI 3.0; in FMI 2.0 its values, in row-major order, have consecutive ones from
    `first` on (FMI 3.0, section 2.2.7.1, has the same order).
    """

    variable: Variable
    shape: tuple[int, ...]
    first: int
    reference: int

    @property
    def size(self) -> int:
        """Number of values."""
        return prod(self.shape)

    def type_in(self, fmi: int) -> str:
        """Real, Integer or String in FMI 2, Float64, Int32 or String in FMI 3."""
        return _TYPES[fmi][type(self.variable.start)]

    def names(self) -> Iterator[str]:
        """Names of the scalars, in the order of their value references."""
        return scalar_names(self.variable.name, self.shape)


#: The independent variable, which FMI 3.0 wants declared (section 2.4.7.4); in FMI 2.0 it has no place.
TIME = Run(Variable("time", Causality.OUTPUT, "s", "time that the unit has reached"), (), first=-1, reference=0)


def scalar_names(name: str, shape: tuple[int, ...]) -> Iterator[str]:
    """Scalars of an array in FMI's structured convention, base 1 and row-major: `potential[7]`, `fiber[12,3]`."""
    if not shape:
        yield name
        return
    for indices in product(*(range(1, count + 1) for count in shape)):
        yield f"{name}[{','.join(map(str, indices))}]"


def layout(unit: type[Unit], mesh: Mesh) -> tuple[Run, ...]:
    """The runs of all variables of `unit` on `mesh`, in the order of declaration.

    Value references are unique over all types. In FMI 2.0 the index of a scalar in the model description is its value
    reference plus one; in FMI 3.0 they count from the time's.
    """
    runs: list[Run] = []
    first = 0
    for reference, variable in enumerate(unit.variables(), start=TIME.reference + 1):
        runs.append(Run(variable, variable.shape(mesh), first, reference))
        first += runs[-1].size
    return tuple(runs)
