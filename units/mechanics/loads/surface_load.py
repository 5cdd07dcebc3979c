"""What a load on a part of the surface is."""

from typing import Protocol

from ...arrays import FloatArray, IntArray


class SurfaceLoad(Protocol):
    """A load by its potential energy, for a size of 1; what it adds to a solid is its size times that.

    Displacements are in mm, shape (nodes, 3). `nodes` are the numbers of its faces' nodes, shape (faces, face nodes).
    """

    nodes: IntArray

    def energy(self, displacement: FloatArray) -> float:
        """The potential."""

    def forces(self, displacement: FloatArray) -> FloatArray:
        """Its derivative by the displacement, shape (nodes, 3)."""

    def stiffness(self, displacement: FloatArray) -> FloatArray:
        """Its second derivative, a symmetric matrix for each face, (faces, face nodes, 3, face nodes, 3)."""
