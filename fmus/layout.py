"""Where a unit's variables sit among the FMI scalars: one run of value references per variable."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod

from ..units.mesh import Mesh
from ..units.unit import Unit
from ..units.variable import Variable

#: FMI 2.0 type of a variable, by the Python type of its start value.
FMI_TYPES: dict[type, str] = {float: "Real", int: "Integer", str: "String"}


@dataclass(frozen=True)
class Run:
    """A variable's scalars: consecutive value references from `first`, in row-major order of `shape`."""

    variable: Variable
    shape: tuple[int, ...]
    first: int

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)

    @property
    def fmi_type(self) -> str:
        """Real, Integer or String."""
        return FMI_TYPES[type(self.variable.start)]

    def names(self) -> Iterator[str]:
        """Names of the scalars, in the order of their value references."""
        return scalar_names(self.variable.name, self.shape)


def scalar_names(name: str, shape: tuple[int, ...]) -> Iterator[str]:
    """Scalars of an array in FMI's structured convention, base 1 and row-major: `potential[7]`, `fiber[12,3]`."""
    if not shape:
        yield name
        return
    for indices in product(*(range(1, count + 1) for count in shape)):
        yield f"{name}[{','.join(map(str, indices))}]"


def layout(unit: type[Unit], mesh: Mesh) -> tuple[Run, ...]:
    """The runs of all variables of `unit` on `mesh`, in the order of declaration.

    Value references are unique over all types, and the index of a scalar in the model description is its value
    reference plus one.
    """
    runs, first = [], 0
    for variable in unit.variables():
        runs.append(Run(variable, variable.shape(mesh), first))
        first += runs[-1].size
    return tuple(runs)
