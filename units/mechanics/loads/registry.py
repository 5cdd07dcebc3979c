"""The loads on the surface that do not change in a run. A new one is a file of its own and a line here.

Pressures in the cavities change, and are inputs of the unit (`cavity_pressure`); the active stress acts in all of the
tissue (`active_stress`).
"""

from typing import Protocol

from ...mesh import Mesh
from ..elements.space import Space
from .springs import Pericardium
from .surface_load import SurfaceLoad


class Support(Protocol):
    """A load that is always there: a frozen dataclass of its parameters, which become the unit's."""

    def on(self, mesh: Mesh, space: Space) -> tuple[float, SurfaceLoad] | None:
        """Its size in MPa and the load for a size of 1, or None where its parameters say that there is none."""


SUPPORTS: tuple[type[Support], ...] = (Pericardium,)
