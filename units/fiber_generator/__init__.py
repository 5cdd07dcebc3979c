"""Rule-based fibres: the way through the wall, and the rotation around it."""

from .unit import FiberGenerator

__all__ = ["FiberGenerator"]
