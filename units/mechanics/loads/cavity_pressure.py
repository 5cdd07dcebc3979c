"""The pressure in a cavity, which follows the deforming wall: its potential is −p V(u).

    V = −∫ x n_x,   ∂V/∂u = −∫ n · ∂u,   n out of the tissue

As long as the rim of the cavity does not move, or there is none, the enclosed volume V is a potential and the second
derivative is symmetric (Schweizerhof & Ramm 1984); this is so where the rim lies on the base. On a surface whose edges
move the force −p n is still that of the pressure, and the symmetric part of its derivative is given.
"""

import numpy as np

from ...arrays import FloatArray, IntArray
from ..elements.space import Space

#: ε_ijk, by which e_j × v is written for all j at once.
_PERMUTATION = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _PERMUTATION[_i, _j, _k], _PERMUTATION[_i, _k, _j] = 1.0, -1.0


class CavityPressure:
    """A pressure of 1 MPa on faces; see SurfaceLoad.

    Parameters
    ----------
    space:
        The displacement's nodes and elements.
    faces:
        Faces by their vertices with normals out of the tissue, shape (faces, 3).
    """

    def __init__(self, space: Space, faces: IntArray) -> None:
        self.nodes = space.face_nodes(faces)
        self._points, self._rule = space.points, space.face_rule

    def volume(self, displacement: FloatArray) -> float:
        """V in mm³; exact for the surface that the elements describe."""
        x, y, z = (self._points + displacement)[self.nodes].transpose(2, 0, 1)
        first, second = self._rule.derivatives[:, :, 0].T, self._rule.derivatives[:, :, 1].T
        # Written out, for it is an output of every step: x times the first component of x,ξ × x,η.
        normal = (y @ first) * (z @ second) - (z @ first) * (y @ second)
        return -float((x @ self._rule.values.T * normal).sum(axis=0) @ self._rule.weights)

    def energy(self, displacement: FloatArray) -> float:
        """See SurfaceLoad; −V, in N mm."""
        return -self.volume(displacement)

    def forces(self, displacement: FloatArray) -> FloatArray:
        """See SurfaceLoad; in N."""
        normals = self._normals((self._points + displacement)[self.nodes])
        parts = np.einsum("q,qa,fqi->fai", self._rule.weights, self._rule.values, normals)
        slots = (3 * self.nodes[:, :, None] + np.arange(3)).ravel()
        return np.asarray(np.bincount(slots, parts.ravel(), displacement.size), dtype=np.float64).reshape(-1, 3)

    def stiffness(self, displacement: FloatArray) -> FloatArray:
        """See SurfaceLoad; in N/mm."""
        rule = self._rule
        first, second = self._tangents((self._points + displacement)[self.nodes])
        # ∂(x,ξ × x,η)/∂x_b = N_b,ξ (e_j × x,η) − N_b,η (e_j × x,ξ).
        turned = np.einsum("qb,fqk->fqbk", rule.derivatives[:, :, 0], second)
        turned -= np.einsum("qb,fqk->fqbk", rule.derivatives[:, :, 1], first)
        matrices = np.einsum("q,qa,ijk,fqbk->faibj", rule.weights, rule.values, _PERMUTATION, turned, optimize=True)
        return np.asarray(0.5 * (matrices + matrices.transpose(0, 3, 4, 1, 2)))

    def _tangents(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """x,ξ and x,η, shape (faces, points, 3), of faces with their nodes `at`, shape (faces, face nodes, 3)."""
        both = np.einsum("qad,fai->fqdi", self._rule.derivatives, at)
        return both[:, :, 0], both[:, :, 1]

    def _normals(self, at: FloatArray) -> FloatArray:
        """x,ξ × x,η, shape (faces, points, 3)."""
        return np.cross(*self._tangents(at))
