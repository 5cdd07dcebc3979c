"""Springs on a part of the surface, against displacement along its undeformed normal: ½ ∫ (u·N)².

What stands for the pericardium and the organs around in many models (Pfaller et al. 2019, without their dashpots).
"""

from dataclasses import dataclass

import numpy as np

from ...arrays import FloatArray, IntArray
from ...mesh import Mesh
from ...variable import parameter
from ..elements.space import Space
from .surface_load import SurfaceLoad

_MPA_PER_KPA = 1e-3


@dataclass(frozen=True)
class Pericardium:
    """Springs on the epicardium."""

    epicardium_stiffness_kPa_per_mm: float = parameter(
        0.0, "kPa/mm", "stiffness of springs along the normal of the epicardium; 0: none", at_least=0.0
    )

    def on(self, mesh: Mesh, space: Space) -> tuple[float, SurfaceLoad] | None:
        """See Support."""
        if not self.epicardium_stiffness_kPa_per_mm:
            return None
        return _MPA_PER_KPA * self.epicardium_stiffness_kPa_per_mm, Springs(space, mesh.boundary("epicardium"))


class Springs:
    """Springs of 1 MPa/mm on faces; see SurfaceLoad, whose displacements they answer linearly.

    Parameters
    ----------
    space:
        The displacement's nodes and elements.
    faces:
        Faces by their vertices, shape (faces, 3).
    """

    def __init__(self, space: Space, faces: IntArray) -> None:
        self.nodes = space.face_nodes(faces)
        rule, at = space.face_rule, space.points[self.nodes]
        # Of straight faces the normal is the same everywhere.
        normal = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
        twice_area = np.linalg.norm(normal, axis=1)
        normal /= twice_area[:, None]
        products = np.einsum("q,qa,qb->ab", rule.weights, rule.values, rule.values)
        self._matrices = np.einsum("f,ab,fi,fj->faibj", twice_area, products, normal, normal)

    def energy(self, displacement: FloatArray) -> float:
        """See SurfaceLoad; in N mm."""
        return 0.5 * float(np.sum(self.forces(displacement) * displacement))

    def forces(self, displacement: FloatArray) -> FloatArray:
        """See SurfaceLoad; in N."""
        parts = np.einsum("faibj,fbj->fai", self._matrices, displacement[self.nodes])
        slots = (3 * self.nodes[:, :, None] + np.arange(3)).ravel()
        return np.asarray(np.bincount(slots, parts.ravel(), displacement.size), dtype=np.float64).reshape(-1, 3)

    def stiffness(self, displacement: FloatArray) -> FloatArray:
        """See SurfaceLoad; in N/mm."""
        return self._matrices
