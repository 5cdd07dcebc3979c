"""Accelerations of a fixed-point iteration x ← H(x): each makes the next iterate from those so far."""

from .acceleration import Acceleration
from .aitken import Aitken
from .anderson import Anderson
from .relaxation import Relaxation

__all__ = ["Acceleration", "Aitken", "Anderson", "Relaxation"]
