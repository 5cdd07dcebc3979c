"""Mean strains of the wall along directions in it: what tells by how much it thickens and shortens.

    ε = (1/V) ∫ e·E e dV,   E = ½ (FᵀF − 1), the Green-Lagrange strain,   e fixed in the undeformed tissue

With F = 1 + ∂u/∂X this is exactly quadratic in the displacement, of which nothing but the coefficients is kept:

    ε = g·u + ½ u·K u,   g = (1/V) ∫ e (e·∇N),   K = (1/V) ∫ (e·∇N)(e·∇N) for each component of u

so that a rigid body has no strain but for rounding, and one at rest none at all.
"""

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import FloatArray
from .elements.space import Space


class WallStrain:
    """The mean strain along one direction as a function of the displacement in mm, shape (nodes, 3).

    Parameters
    ----------
    space:
        The displacement's nodes and elements.
    tissue:
        Over which elements the mean is, shape (elements,).
    direction:
        e, unit vectors of shape (elements, 3).
    """

    def __init__(self, space: Space, tissue: np.ndarray, direction: FloatArray) -> None:
        nodes, along = space.nodes[tissue], direction[tissue]
        slopes = np.einsum("epai,ei->epa", space.gradients[tissue], along)
        points, corners = slopes.shape[:2], slopes.shape[2]
        weights = space.weights[tissue] / space.weights[tissue].sum()
        # From the nodes to the derivatives along e at the integration points.
        columns = np.repeat(nodes, points[1], axis=0)
        starts = np.arange(0, columns.size + 1, corners)
        derivative = csr_matrix((slopes.ravel(), columns.ravel(), starts), (len(columns), len(space.points)))
        weighted = derivative.multiply(weights.reshape(-1, 1)).tocsr()
        self._linear: FloatArray = np.asarray(weighted.T @ np.repeat(along, points[1], axis=0))
        self._quadratic: csr_matrix = (weighted.T @ derivative).tocsr()

    def mean(self, displacement: FloatArray) -> float:
        """ε, a pure number; where the tissue is stretched by λ along e it is ½ (λ² − 1)."""
        return float(np.sum((self._linear + 0.5 * (self._quadratic @ displacement)) * displacement))

    def gradient(self, displacement: FloatArray) -> FloatArray:
        """Its derivative by the displacement in 1/mm, shape (nodes, 3)."""
        return np.asarray(self._linear + self._quadratic @ displacement)
