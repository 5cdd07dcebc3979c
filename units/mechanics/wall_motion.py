"""How the left ventricle's wall moves, in the numbers of the clinic: its twist and its mean strains.

They are defined where the mesh has a left ventricle's wall (`BOUNDARIES`), and are 0 elsewhere; in a biventricle the
wall of the left ventricle counts, with the septum and without the right ventricle's free wall (`mesh/lv_wall`). A
strain is negative where the wall shortens: a healthy heart shortens along its circumference and its length in systole,
and its wall thickens.
"""

from functools import cached_property

import numpy as np

from ..arrays import FloatArray
from ..mesh import Mesh
from ..mesh.lv_wall import lv_tissue, wall_directions
from ..variable import Causality, Record, Variable
from .elements.space import Space
from .twist import Twist
from .wall_strain import WallStrain

#: What bounds the left ventricle's wall.
BOUNDARIES = ("lv_endocardium", "epicardium")

_TWIST = "twist"
_DIRECTIONS = ("radial", "circumferential", "longitudinal")


def wall_outputs(depends_on: tuple[str, ...]) -> tuple[Variable, ...]:
    """The outputs, which follow the inputs `depends_on`."""
    texts = {
        _TWIST: (
            "deg",
            "rotation of the left ventricle's apex less that of its base, counterclockwise as seen from the apex; 0 "
            "without one",
        )
    }
    texts |= {
        f"{direction}_strain": (
            "1",
            f"mean {direction} Green-Lagrange strain of the left ventricle's wall; 0 without a left ventricle",
        )
        for direction in _DIRECTIONS
    }
    return tuple(
        Variable(
            name,
            Causality.OUTPUT,
            unit,
            description,
            depends_on=depends_on,
            record=Record.VALUE,
            recorded_with=BOUNDARIES,
        )
        for name, (unit, description) in texts.items()
    )


class WallMotion:
    """The outputs as functions of the displacement in mm, shape (nodes of `space`, 3).

    Its parts are made when they are asked for first, for not every run asks.
    """

    def __init__(self, mesh: Mesh, space: Space) -> None:
        self._mesh, self._space = mesh, space
        self.exists = set(BOUNDARIES) <= set(mesh.boundaries)

    def value(self, name: str, displacement: FloatArray) -> float:
        """The output `name`: degrees, or a pure number.

        Raises InvalidInput for boundaries that contradict each other, and for too coarse a wall.
        """
        if not self.exists:
            return 0.0
        if name == _TWIST:
            return self._twist.degrees(displacement[: self._mesh.nodes])
        return self._strains[name].mean(displacement)

    def gradient(self, name: str, displacement: FloatArray) -> FloatArray:
        """Its derivative by the displacement in its unit of measure per mm, shape (nodes of `space`, 3)."""
        result = np.zeros_like(displacement)
        if self.exists and name == _TWIST:
            result[: self._mesh.nodes] = self._twist.gradient(displacement[: self._mesh.nodes])
        elif self.exists:
            result = self._strains[name].gradient(displacement)
        return result

    @cached_property
    def _tissue(self) -> np.ndarray:
        return lv_tissue(self._mesh)

    @cached_property
    def _twist(self) -> Twist:
        return Twist(self._mesh, self._tissue)

    @cached_property
    def _strains(self) -> dict[str, WallStrain]:
        directions = wall_directions(self._mesh)
        return {f"{name}_strain": WallStrain(self._space, self._tissue, directions[name]) for name in _DIRECTIONS}
