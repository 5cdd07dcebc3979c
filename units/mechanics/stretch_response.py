"""How the stretch answers a small change of the active stress, at a deformed state: the tangent's view of a solid."""

import numpy as np

from ..arrays import FloatArray
from .solid import Solid
from .solvers.superlu import SuperLU


class StretchResponse:
    """The linear map from changes of the active stress at the vertices to changes of the elements' stretch.

    Parameters
    ----------
    solid:
        What is deformed.
    displacement:
        Its equilibrium in mm, shape (nodes, 3).
    loads:
        The loads in MPa that it is under, shape (loads,).
    """

    def __init__(self, solid: Solid, displacement: FloatArray, loads: FloatArray) -> None:
        self._solid, self._displacement = solid, displacement
        # In double precision, whatever the equilibria are found with: nothing corrects what comes out.
        self._solve = SuperLU()(solid.tangent(displacement, loads))

    def __call__(self, change: FloatArray) -> FloatArray:
        """δλ, shape (elements,), for a `change` of the active stress in MPa, shape (vertices,)."""
        solid = self._solid
        step = self._solve(-solid.active_forces(self._displacement, change))
        moved = solid.moved(np.zeros_like(self._displacement), step)
        return solid.active_stiffness.stretch_change(self._displacement, moved)
