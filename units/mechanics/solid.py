"""The discretised solid: energy, residual force and tangent of linear tetrahedra under active stress.

The active stress is a second Piola–Kirchhoff stress, fixed while the solid deforms: it has the potential
½ s_a (a₀·C a₀ + 0.4 s₀·C s₀ + 0.4 n₀·C n₀), so that equilibrium is the minimum of an energy.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import FloatArray, IntArray
from ..mesh import Mesh
from ..mesh.finite_elements import shape_gradients
from ..mesh.sparsity import Pattern
from ..variable import parameter
from .kinematics import VOIGT_COLUMNS, VOIGT_ROWS, Kinematics, determinant


class StrainEnergy(Protocol):
    """A hyperelastic law: energy, second Piola–Kirchhoff stress, and tangent in Voigt notation (MPa)."""

    def energy(self, at: Kinematics) -> FloatArray:
        """W, shape (elements,)."""

    def stress(self, at: Kinematics) -> FloatArray:
        """S = 2∂W/∂C, shape (elements, 3, 3)."""

    def tangent(self, at: Kinematics) -> FloatArray:
        """4∂²W/∂C², shape (elements, 6, 6)."""


@dataclass(frozen=True)
class ActiveShares:
    """How the active stress acts across the fibre (Bakir et al. 2018)."""

    active_share_sheet: float = parameter(0.4, "1", "part of the active stress along the sheet", at_least=0.0)
    active_share_normal: float = parameter(
        0.4, "1", "part of the active stress normal to fibre and sheet", at_least=0.0
    )

    def tensor(self, fiber: FloatArray, sheet: FloatArray) -> FloatArray:
        """a₀⊗a₀ + share s₀⊗s₀ + share n₀⊗n₀, shape (elements, 3, 3)."""
        normal = np.cross(fiber, sheet)
        return _square(fiber) + self.active_share_sheet * _square(sheet) + self.active_share_normal * _square(normal)


def _square(direction: FloatArray) -> FloatArray:
    return direction[:, :, None] * direction[:, None, :]


class Solid:
    """Linear tetrahedra of one material.

    Parameters
    ----------
    mesh, fiber, sheet:
        Mesh and directions, shape (elements, 3).
    laws:
        Strain energies that add up.
    active_tensor:
        Stress per unit of active stress, shape (elements, 3, 3).
    fixed:
        Nodes whose displacement is zero.
    """

    def __init__(
        self, mesh: Mesh, fiber: FloatArray, laws: Sequence[StrainEnergy], active_tensor: FloatArray, fixed: IntArray
    ) -> None:
        self._cells = mesh.cells
        self._volumes = mesh.volumes
        self._gradients = shape_gradients(mesh)
        self._laws = laws
        self._structure = _square(fiber)
        self._active = active_tensor
        self.free = np.ones((mesh.nodes, 3), dtype=bool)
        self.free[fixed] = False
        self.unknowns = int(self.free.sum())
        numbers = np.full((mesh.nodes, 3), -1)
        numbers[self.free] = np.arange(self.unknowns)
        dofs = numbers[mesh.cells].reshape(mesh.elements, 12)
        self._force_slot = np.where(dofs >= 0, dofs, self.unknowns).ravel()
        self._pattern = Pattern(dofs, self.unknowns)

    def gradient(self, displacement: FloatArray) -> FloatArray:
        """F = 1 + ∂u/∂X, shape (elements, 3, 3), for nodal displacements in mm, shape (nodes, 3)."""
        return np.eye(3) + displacement[self._cells].transpose(0, 2, 1) @ self._gradients

    def stretch(self, displacement: FloatArray) -> FloatArray:
        """λ = √(a₀·C a₀), shape (elements,)."""
        gradient = self.gradient(displacement)
        squared = np.einsum("eij,eij->e", gradient.transpose(0, 2, 1) @ gradient, self._structure)
        return np.asarray(np.sqrt(squared))

    def volume_ratio(self, displacement: FloatArray) -> FloatArray:
        """J = det F, shape (elements,)."""
        return determinant(self.gradient(displacement))

    def reference_stress(self) -> float:
        """Largest component of the passive stress in the undeformed solid, in MPa; zero for a sound material."""
        undeformed = np.broadcast_to(np.eye(3), self._structure.shape)
        at = Kinematics.of(undeformed, np.ones(len(self._cells)), self._structure)
        return float(np.abs(sum(law.stress(at) for law in self._laws)).max())

    def energy(self, displacement: FloatArray, tension: FloatArray) -> float:
        """Total potential energy in N mm; infinite where an element is inverted. `tension` is nodal, in MPa."""
        return self.energy_and_residual(displacement, tension)[0]

    def residual(self, displacement: FloatArray, tension: FloatArray) -> FloatArray:
        """Out-of-balance force in N at the free degrees of freedom; NaN where an element is inverted."""
        return self.energy_and_residual(displacement, tension)[1]

    def energy_and_residual(self, displacement: FloatArray, tension: FloatArray) -> tuple[float, FloatArray]:
        """Both at once; they share the kinematics."""
        gradient = self.gradient(displacement)
        ratio = determinant(gradient)
        if not ratio.min() > 0.0:
            return np.inf, np.full(self.unknowns, np.nan)
        at = Kinematics.of(gradient, ratio, self._structure)
        density = sum(law.energy(at) for law in self._laws)
        active = 0.5 * self._element_tension(tension) * np.einsum("eij,eij->e", self._active, at.cauchy_green)
        stress = self._volumes[:, None, None] * self._stress(at, tension)
        force = self._gradients @ (stress @ gradient.transpose(0, 2, 1))
        residual = np.bincount(self._force_slot, force.ravel(), self.unknowns + 1)[:-1]
        return float(self._volumes @ (density + active)), np.asarray(residual, dtype=np.float64)

    def tangent(self, displacement: FloatArray, tension: FloatArray) -> csr_matrix:
        """Derivative of the residual by the free degrees of freedom, in N/mm. Needs det F > 0."""
        gradient = self.gradient(displacement)
        at = Kinematics.of(gradient, determinant(gradient), self._structure)
        material = sum(law.tangent(at) for law in self._laws)
        strain = self._strain_operator(gradient)
        # Contiguous factors make the stack of small products four times as fast.
        matrices = np.ascontiguousarray(strain.transpose(0, 2, 1)) @ (material @ strain)
        initial = self._gradients @ self._stress(at, tension) @ self._gradients.transpose(0, 2, 1)
        blocks = matrices.reshape(-1, 4, 3, 4, 3)
        for axis in range(3):
            blocks[:, :, axis, :, axis] += initial
        return self._pattern.matrix(self._volumes[:, None, None] * matrices)

    def _stress(self, at: Kinematics, tension: FloatArray) -> FloatArray:
        passive = sum(law.stress(at) for law in self._laws)
        return np.asarray(passive + self._element_tension(tension)[:, None, None] * self._active)

    def _element_tension(self, tension: FloatArray) -> FloatArray:
        # Exact: the integral of a linear field over an element is the mean of its nodal values times the volume.
        return np.asarray(tension[self._cells].mean(axis=1))

    def _strain_operator(self, gradient: FloatArray) -> FloatArray:
        """B with δE (Voigt, engineering shears) = B δu, shape (elements, 6, 12)."""
        product = np.einsum("eki,eaj->eijak", gradient, self._gradients)
        rows = product[:, VOIGT_ROWS, VOIGT_COLUMNS]
        rows[:, 3:] += product[:, VOIGT_COLUMNS[3:], VOIGT_ROWS[3:]]
        return np.asarray(rows.reshape(len(gradient), 6, 12))
