"""The active stiffness: how the active stress changes with the stretch while an equilibrium is sought.

    S = (s_a + w K_a (λ − λ_ref)) (a₀⊗a₀ + 0.4 s₀⊗s₀ + 0.4 n₀⊗n₀),   λ = √(a₀·C a₀), averaged around each node

Where the active stress depends on the stretch, a mechanics that holds it over a step answers with the wrong stiffness:
explicit coupling then multiplies an error by −K_a/K_p in every step, however short. With K_a = ∂s_a/∂λ at the stretch
λ_ref that the active stress has seen it answers with the right one, and is where s_a is once λ = λ_ref. Source:
Regazzoni & Quarteroni 2021 (Comput. Methods Appl. Mech. Engrg. 373, 113506).

The stretch is averaged as the active stress does it. An element's own stretch in its place would leave an error in what
the average smooths out, and extrapolated Jacobi coupling unstable.

This stress has no potential, so that its derivative by the displacement is not symmetric, and it reaches beyond an
element. Forces are exact; the stiffness that is factorised has the fibres' own answer, element by element, and is a
preconditioner of the rest (`solvers/newton_step`, and the quasi-Newton method by what its steps have shown).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ...arrays import FloatArray
from ...mesh.averages import around_nodes
from ...variable import parameter
from ..elements.space import Space


@dataclass(frozen=True)
class Stabilization:
    """How much of the active stiffness counts."""

    stabilization: float = parameter(
        1.0,
        "1",
        "w, share of the active stiffness that the equilibrium takes into account; 0 leaves it out",
        at_least=0.0,
    )


@dataclass(frozen=True)
class StretchDependence:
    """What the active stress says of its dependence on the stretch.

    `stiffness` is w K_a in MPa at the vertices, shape (vertices,); `reference` is λ_ref, shape (elements,).
    """

    stiffness: FloatArray
    reference: FloatArray


class ActiveStiffness:
    """The active stress beyond the one given. Displacements are in mm, shape (nodes, 3).

    Parameters
    ----------
    space:
        The displacement's nodes and elements.
    fiber:
        a₀, shape (elements, 3).
    """

    def __init__(self, space: Space, fiber: FloatArray) -> None:
        self._nodes, self._weights, self._shares = space.nodes, space.weights, space.vertex_shares
        volumes = space.weights.sum(axis=1)
        #: What averages around the nodes, shape (vertices, elements).
        self.average: csr_matrix = around_nodes(space.nodes[:, :4], volumes)
        self._fiber = fiber[:, None, :]
        #: a₀·∇N, shape (elements, points, element nodes).
        self._along = np.einsum("epai,ei->epa", space.gradients, fiber)

    def stress(self, stretch: FloatArray, of: StretchDependence) -> FloatArray:
        """w K_a (λ − λ_ref) in MPa at the vertices, shape (vertices,); `stretch` has shape (elements,)."""
        return np.asarray(of.stiffness * (self.average @ (stretch - of.reference)))

    def stiffness(self, displacement: FloatArray, of: StretchDependence) -> FloatArray:
        """The fibres' response w K_a/λ in N/mm, where it is positive, shape (elements, n, 3, n, 3); n element nodes."""
        fiber = self._deformed(displacement)
        stretch = _length(fiber).mean(axis=1)
        at_points = of.stiffness[self._nodes[:, :4]] @ self._shares.T
        answer = np.maximum(np.sum(self._weights * at_points, axis=1), 0.0) / stretch
        moved = np.einsum("epa,epi->eai", self._along, fiber) / self._weights.shape[1]
        return np.asarray(np.einsum("e,eai,ebj->eaibj", answer, moved, moved, optimize=True))

    def stretch_gradient(self, displacement: FloatArray) -> FloatArray:
        """∂λ by the displacement of an element's nodes in 1/mm, shape (elements, element nodes, 3)."""
        fiber = self._deformed(displacement)
        directions = fiber / _length(fiber)[:, :, None]
        return np.einsum("epa,epi->eai", self._along, directions) / self._weights.shape[1]

    def _deformed(self, displacement: FloatArray) -> FloatArray:
        """F a₀ at the points, shape (elements, points, 3)."""
        return np.asarray(self._fiber + self._along @ displacement[self._nodes])


def _length(vectors: FloatArray) -> FloatArray:
    """Lengths of vectors, shape (elements, points, 3) to (elements, points)."""
    return np.asarray(np.sqrt(np.einsum("epi,epi->ep", vectors, vectors)))
