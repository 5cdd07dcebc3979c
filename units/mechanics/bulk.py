"""The tissue between the surfaces: energy, forces and stiffness of the passive laws and of the active stress, in NumPy.

What `compiled_bulk` does faster; this is its fallback and its oracle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import FloatArray
from .elements.space import Space
from .kinematics import VOIGT_COLUMNS, VOIGT_ROWS, Kinematics, determinant, square
from .laws.law import Law
from .stiffness import StiffnessPattern


@dataclass(frozen=True)
class Tissue:
    """What fills the elements: directions, shape (elements, 3), laws, and stress per unit of active stress.

    `active_tensor` has shape (elements, 3, 3).
    """

    fiber: FloatArray
    sheet: FloatArray
    laws: Sequence[Law]
    active_tensor: FloatArray


class Bulk(Protocol):
    """Energy, forces and stiffness of the tissue; displacements in mm, shape (nodes, 3), tension in MPa at vertices."""

    def forces(
        self, displacement: FloatArray, tension: FloatArray, with_energy: bool
    ) -> tuple[float, FloatArray] | None:
        """Energy in N mm (0 unless wanted) and its derivative in N, shape (nodes, 3); None for an inverted element."""

    def stiffness(self, displacement: FloatArray, tension: FloatArray) -> FloatArray:
        """Derivative of the forces in N/mm on the pattern, shape (blocks, 3, 3). Needs det F > 0."""

    def stretch(self, displacement: FloatArray) -> FloatArray:
        """λ = √(a₀·C a₀), the mean over an element's points, shape (elements,)."""


class NumpyBulk:
    """See Bulk."""

    def __init__(self, space: Space, tissue: Tissue, pattern: StiffnessPattern) -> None:
        self._nodes, self._weights = space.nodes, space.weights.ravel()
        self._points_per_element = space.weights.shape[1]
        self._gradients = space.gradients.reshape(-1, *space.gradients.shape[2:])
        self._vertices, self._shares = space.nodes[:, :4], space.vertex_shares
        self._laws, self._pattern = tissue.laws, pattern
        self._structure = self._at_points(square(tissue.fiber))
        self._sheet_structure = self._at_points(square(tissue.sheet))
        self._active = self._at_points(tissue.active_tensor)
        degrees = 3 * space.nodes[:, :, None] + np.arange(3)
        self._force_slot = self._at_points(degrees.reshape(len(space.nodes), -1)).ravel()
        self._nodes_count = len(space.points)

    def gradient(self, displacement: FloatArray) -> FloatArray:
        """F = 1 + ∂u/∂X, shape (points, 3, 3)."""
        moved = self._at_points(displacement[self._nodes].transpose(0, 2, 1))
        return np.eye(3) + moved @ self._gradients

    def forces(
        self, displacement: FloatArray, tension: FloatArray, with_energy: bool
    ) -> tuple[float, FloatArray] | None:
        """See Bulk."""
        gradient = self.gradient(displacement)
        ratio = determinant(gradient)
        if not ratio.min() > 0.0:
            return None
        at, here = self._kinematics(gradient, ratio), self._tension(tension)
        stress = self._weights[:, None, None] * self._stress(at, here)
        force = self._gradients @ (stress @ gradient.transpose(0, 2, 1))
        summed = np.bincount(self._force_slot, force.ravel(), 3 * self._nodes_count)
        total: FloatArray = np.asarray(summed, dtype=np.float64).reshape(-1, 3)
        if not with_energy:
            return 0.0, total
        density = sum(law.energy(at) for law in self._laws)
        active = 0.5 * here * np.einsum("pij,pij->p", self._active, at.cauchy_green)
        return float(self._weights @ (density + active)), total

    def stiffness(self, displacement: FloatArray, tension: FloatArray) -> FloatArray:
        """See Bulk."""
        gradient = self.gradient(displacement)
        at = self._kinematics(gradient, determinant(gradient))
        material = sum(law.tangent(at) for law in self._laws)
        strain = self._strain_operator(gradient)
        # Contiguous factors make the stack of small products four times as fast.
        matrices = np.ascontiguousarray(strain.transpose(0, 2, 1)) @ (material @ strain)
        initial = self._gradients @ self._stress(at, self._tension(tension)) @ self._gradients.transpose(0, 2, 1)
        corners = self._gradients.shape[1]
        parts = matrices.reshape(-1, corners, 3, corners, 3)
        for axis in range(3):
            parts[:, :, axis, :, axis] += initial
        parts *= self._weights[:, None, None, None, None]
        blocks = np.zeros((self._pattern.blocks, 3, 3))
        elements = len(self._nodes)
        summed = parts.reshape(elements, -1, *parts.shape[1:]).sum(axis=1)
        self._pattern.add(blocks, self._pattern.slots, summed)
        return blocks

    def stretch(self, displacement: FloatArray) -> FloatArray:
        """See Bulk."""
        gradient = self.gradient(displacement)
        squared = np.einsum("pij,pij->p", gradient.transpose(0, 2, 1) @ gradient, self._structure)
        return np.asarray(np.sqrt(squared).reshape(len(self._nodes), -1).mean(axis=1))

    def active_forces(self, displacement: FloatArray) -> FloatArray:
        """Derivative of the forces in N by the active stress in MPa at an element's four vertices.

        Shape (elements, element nodes, 3, 4).
        """
        pulled = self._gradients @ self._active @ self.gradient(displacement).transpose(0, 2, 1)
        pulled *= self._weights[:, None, None]
        return np.einsum("epai,pv->eaiv", pulled.reshape(len(self._nodes), -1, *pulled.shape[1:]), self._shares)

    def _kinematics(self, gradient: FloatArray, ratio: FloatArray) -> Kinematics:
        return Kinematics.of(gradient, ratio, self._structure, self._sheet_structure)

    def _stress(self, at: Kinematics, tension: FloatArray) -> FloatArray:
        passive = sum(law.stress(at) for law in self._laws)
        return np.asarray(passive + tension[:, None, None] * self._active)

    def _tension(self, tension: FloatArray) -> FloatArray:
        """The linear field at the integration points, shape (points,)."""
        return np.asarray(tension[self._vertices] @ self._shares.T).ravel()

    def _at_points(self, values: np.ndarray) -> np.ndarray:
        """The elements' values at each of their points, shape (elements, ...) to (points, ...)."""
        return values if self._points_per_element == 1 else np.repeat(values, self._points_per_element, axis=0)

    def _strain_operator(self, gradient: FloatArray) -> FloatArray:
        """B with δE (Voigt, engineering shears) = B δu, shape (points, 6, 3 element nodes)."""
        product = np.einsum("pki,paj->pijak", gradient, self._gradients)
        rows = product[:, VOIGT_ROWS, VOIGT_COLUMNS]
        rows[:, 3:] += product[:, VOIGT_COLUMNS[3:], VOIGT_ROWS[3:]]
        return np.asarray(rows.reshape(len(gradient), 6, -1))
