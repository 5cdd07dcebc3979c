"""The tension of elements that are in equilibrium by themselves, where it follows the stretch of all around them.

    s = M (s_a + w K_a A (λ(s) − λ_ref))

A averages stretches around the nodes, M active stresses over an element's nodes, and λ(s) is each element's own
(`local_equilibrium`). Newton's method solves for the tensions s. Source: Regazzoni & Quarteroni 2021
(`loads/active_stiffness`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags_array, identity
from scipy.sparse.linalg import SuperLU, splu

from ..arrays import FloatArray
from ..mesh import Mesh
from ..mesh.averages import around_nodes
from .loads.active_stiffness import StretchDependence
from .local_equilibrium import LocalEquilibrium

#: What is left of the tension relative to the modulus, above what elements leave of theirs, and Newton iterations at
#: the most.
_TOLERANCE = 1e-10
_ITERATIONS = 30


class LocalTension:
    """Tensions, and the equilibria under them, of the elements of a mesh."""

    def __init__(self, equilibrium: LocalEquilibrium, mesh: Mesh) -> None:
        self._equilibrium, self._cells = equilibrium, mesh.cells
        #: What averages around the nodes, shape (nodes, elements).
        self.around = around_nodes(mesh.cells, mesh.volumes)
        corners = mesh.cells.shape[1]
        elements = np.repeat(np.arange(mesh.elements), corners)
        shares = np.full(elements.shape, 1.0 / corners)
        self._mean = coo_matrix((shares, (elements, mesh.cells.ravel())), (mesh.elements, mesh.nodes)).tocsr()

    def tangent(self, squares: FloatArray, dependence: StretchDependence) -> "TensionTangent":
        """How tensions respond to changes of the active stress at the equilibria `squares`, shape (elements, 3)."""
        if not dependence.stiffness.any():
            return TensionTangent(self._mean, None)
        slope = diags_array(self._equilibrium.stretch_by_tension(squares))
        back = self._mean @ diags_array(dependence.stiffness) @ self.around @ slope
        return TensionTangent(self._mean, splu((identity(len(squares)) - back).tocsc()))

    def in_elements(self, values: FloatArray) -> FloatArray:
        """The mean over each element's nodes, shape (nodes,) to (elements,)."""
        return np.asarray(values[self._cells].mean(axis=1))

    def squares(
        self, start: FloatArray, before: FloatArray, share: float, stress: FloatArray, dependence: StretchDependence
    ) -> tuple[FloatArray, FloatArray] | None:
        """Squared stretches, shape (elements, 3), and tensions in MPa, shape (elements,); None without convergence.

        They are those on a `share` of the way from the tensions `before`, shape (elements,), to what the active
        `stress` in MPa, shape (nodes,), and its dependence on the stretch ask for. `start` are squared stretches near.
        """
        asked = (1.0 - share) * before + share * self.in_elements(stress)
        if not dependence.stiffness.any():
            squares = self._equilibrium.squares(start, asked)
            return None if squares is None else (squares, asked)
        back = share * (self._mean @ diags_array(dependence.stiffness) @ self.around)
        tension, squares = before, start
        for _ in range(_ITERATIONS):
            found = self._equilibrium.squares(squares, tension)
            if found is None:
                return None
            squares = found
            residual = tension - asked - back @ (np.sqrt(squares[:, 0]) - dependence.reference)
            if np.abs(residual).max() <= _TOLERANCE * self._equilibrium.modulus:
                return squares, tension
            slope = diags_array(self._equilibrium.stretch_by_tension(squares))
            tension = tension - splu((identity(len(tension)) - back @ slope).tocsc()).solve(residual)
        return None


@dataclass(frozen=True)
class TensionTangent:
    """The linear map from changes of the active stress at the nodes to changes of tensions, and its transpose.

    `mean` averages over an element's nodes, shape (elements, nodes); `factors` are those of what the tensions' own
    stretches leave of a change, or None where they do not count.
    """

    mean: csr_matrix
    factors: SuperLU | None

    def along(self, stress: FloatArray) -> FloatArray:
        """δs in MPa, shape (elements,), for a change in MPa at the nodes, shape (nodes,)."""
        asked = self.mean @ stress
        return asked if self.factors is None else np.asarray(self.factors.solve(asked))

    def back(self, gradient: FloatArray) -> FloatArray:
        """The gradient by the active stress, shape (nodes,), for one by the tensions, shape (elements,)."""
        answer = gradient if self.factors is None else self.factors.solve(gradient, "T")
        return np.asarray(self.mean.T @ answer)
