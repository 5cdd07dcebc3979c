"""Mechanics: kinematics, strain energies, the discretised solid, its equilibrium, and the cavities it encloses."""

from .local import LocalMechanics
from .unit import Mechanics

__all__ = ["LocalMechanics", "Mechanics"]
