"""The displacement elements by their order. A new element is a file of its own and a line here."""

from collections.abc import Callable
from dataclasses import dataclass

from ...errors import InvalidInput
from ...mesh import Mesh
from ...variable import parameter
from .linear import linear
from .quadratic import quadratic
from .space import Space

ELEMENTS: dict[int, Callable[[Mesh], Space]] = {1: linear, 2: quadratic}


@dataclass(frozen=True)
class Elements:
    """How finely the displacement is described in each tetrahedron."""

    element_order: int = parameter(
        1,
        "1",
        "polynomial order of the displacement: 1, or 2 for nearly incompressible tissue (some twenty times as slow)",
        at_least=1,
        below=3,
    )

    def space(self, mesh: Mesh) -> Space:
        """The elements on `mesh`."""
        if self.element_order not in ELEMENTS:
            raise InvalidInput(f"parameter 'element_order' is {self.element_order}; take 1 or 2")
        return ELEMENTS[self.element_order](mesh)
