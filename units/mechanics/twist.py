"""The left ventricle's twist: by how much its apical part turns about the long axis against its basal part.

Twist is the rotation of the apical slice less that of the basal one, positive where the apex turns counterclockwise
against the base as seen from the apex, which is what a healthy heart does in systole (Rüssel et al. 2009, JACC
Cardiovasc. Imaging 2, 648-655; Young & Cowan 2012, J. Cardiovasc. Magn. Reson. 14, 49). The base is in the plane
Z = 0 and the apex below, so that this is a negative rotation about Z.

The slices are the basal and the apical third of the cavity's length, as in the 17-segment model (Cerqueira et al. 2002,
Circulation 105, 539-542); tissue counts by its volume, times a weight that falls linearly from 1 in the middle of a
slice to 0 at its ends: sharp ends would make the twist jump with the nodes of a coarse mesh. A slice's rotation is that
of the least-squares fit of a rotation to how it moved in the plane Z = constant, about its own centre:

    φ = arg Z,   Z = Σ w conj(X − X̄) (x − x̄),   X = X + iY before and x = x + iy after the deformation

This needs no centre line, and the tissue at the axis, whose angle means nothing, hardly counts.
"""

from dataclasses import dataclass

import numpy as np
from skfem import ElementTetP1
from skfem.quadrature import get_quadrature

from ..arrays import FloatArray
from ..mesh import Mesh

#: Parts of the cavity's length, of which the first and the last are the slices.
_PARTS = 3

#: Degree of the rule in an element, of 24 points: an element of a coarse mesh reaches through a slice.
_DEGREE = 6


@dataclass(frozen=True)
class Slice:
    """Tissue around a height, which turns as a whole.

    `moments` has for each node Σ w N conj(X − X̄), relative to Σ w |X − X̄|², in 1/mm; complex, shape (nodes,).
    """

    moments: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, tissue: np.ndarray, low: float, high: float) -> "Slice":
        """The slice of `tissue`, a mask of shape (elements,), between two heights in mm."""
        cells = mesh.cells[tissue]
        rule, shares = get_quadrature(ElementTetP1().refdom, _DEGREE)
        values = np.vstack([1.0 - rule.sum(axis=0), rule]).T
        x, y, z = np.einsum("qa,eai->ieq", values, mesh.points[cells])
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        weights = mesh.volumes[tissue][:, None] * shares * np.maximum(1.0 - np.abs(z - middle) / half, 0.0)
        across = x + 1j * y
        across -= np.sum(weights * across) / np.sum(weights)
        parts = np.einsum("eq,qa->ea", weights * across.conj(), values)
        moments = np.zeros(mesh.nodes, dtype=complex)
        np.add.at(moments, cells, parts)
        return cls(moments / np.sum(weights * np.abs(across) ** 2))

    def turn(self, displacement: FloatArray) -> complex:
        """Z/|Z₀|, whose argument is the rotation about Z; `displacement` of the nodes in mm, shape (nodes, 3)."""
        # No inner product of BLAS, whose bits depend on the number of threads.
        return 1.0 + complex(np.sum(self.moments * (displacement[:, 0] + 1j * displacement[:, 1])))


class Twist:
    """The twist as a function of the nodes' displacement, linear between them.

    Parameters
    ----------
    mesh:
        The undeformed body, with a boundary `lv_endocardium`.
    tissue:
        Which elements are the left ventricle's, shape (elements,).
    """

    def __init__(self, mesh: Mesh, tissue: np.ndarray) -> None:
        heights = mesh.points[mesh.boundary_nodes("lv_endocardium"), 2]
        low, high = float(heights.min()), float(heights.max())
        part = (high - low) / _PARTS
        self._apical = Slice.of(mesh, tissue, low, low + part)
        self._basal = Slice.of(mesh, tissue, high - part, high)

    def degrees(self, displacement: FloatArray) -> float:
        """The twist in degrees, from −180 to 180; `displacement` in mm, shape (nodes, 3)."""
        apical, basal = self._apical.turn(displacement), self._basal.turn(displacement)
        return float(np.degrees(np.angle(basal * apical.conjugate())))

    def gradient(self, displacement: FloatArray) -> FloatArray:
        """Its derivative by the displacement in degrees per mm, shape (nodes, 3)."""
        result = np.zeros_like(displacement)
        for each, sign in ((self._basal, 1.0), (self._apical, -1.0)):
            # dφ = Im(dZ/Z), dZ = Σ m (du_x + i du_y).
            relative = sign * each.moments / each.turn(displacement)
            result[:, 0] += relative.imag
            result[:, 1] += relative.real
        return np.asarray(np.degrees(result))
