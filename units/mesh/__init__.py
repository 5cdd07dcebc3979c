"""The mesh of a scene, on disk and in memory, and linear finite elements on it."""

from .simplices import Mesh

__all__ = ["Mesh"]
