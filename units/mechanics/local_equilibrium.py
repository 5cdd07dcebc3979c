"""The equilibrium of tissue by itself, in the axes of fibre, sheet and normal: three equations for three stretches.

    2∂W/∂C_ii + s_a share_i = 0

Of a fibre that is held, the first equation is left out. Source: docs/model.md, Mechanics.
"""

from collections.abc import Sequence

import numpy as np

from ..arrays import FloatArray
from .kinematics import Kinematics
from .laws.law import Law

#: Residual stress relative to the shear modulus, and Newton iterations at the most.
_TOLERANCE = 1e-12
_ITERATIONS = 30


class LocalEquilibrium:
    """Equilibria of a number of elements, each by itself.

    Parameters
    ----------
    elements:
        How many there are.
    laws:
        The passive laws.
    shares:
        How the active stress acts along fibre, sheet and normal, shape (3,).
    isometric:
        Whether the fibre keeps its length.
    """

    def __init__(self, elements: int, laws: Sequence[Law], shares: FloatArray, isometric: bool) -> None:
        # The axes of the material are those of fibre, sheet and normal: their directions in space do not matter.
        self._laws, self._shares = laws, shares
        #: The largest modulus of the laws in MPa, which residuals are relative to.
        self.modulus = max(law.modulus for law in laws)
        self._structure = np.zeros((elements, 3, 3))
        self._structure[:, 0, 0] = 1.0
        self._sheet_structure = np.zeros_like(self._structure)
        self._sheet_structure[:, 1, 1] = 1.0
        self._free = slice(1 if isometric else 0, 3)

    def squares(self, start: FloatArray, tension: FloatArray) -> FloatArray | None:
        """The squared stretches along fibre, sheet and normal, shape (elements, 3); None without convergence.

        `tension` is the active stress in MPa, shape (elements,).
        """
        free, squares = self._free, start.copy()
        for _ in range(_ITERATIONS):
            at = self._at(squares)
            with np.errstate(over="ignore", invalid="ignore"):
                stress = sum(law.stress(at) for law in self._laws)
                residual = (np.einsum("eii->ei", stress) + tension[:, None] * self._shares)[:, free]
                if np.abs(residual).max() <= _TOLERANCE * self.modulus:
                    return squares
                tangent = self._tangent(at)[:, free, free]
            # Where the tissue is torn apart its energy overflows, or has no curvature left.
            if not (np.isfinite(tangent).all() and np.isfinite(residual).all()):
                return None
            try:
                change = -np.linalg.solve(tangent, residual[:, :, None])[:, :, 0]
            except np.linalg.LinAlgError:
                return None
            # No square may lose more than half of itself: it stays positive.
            shrunk = np.max(-change / (0.5 * squares[:, free]), axis=1, initial=1.0)
            squares[:, free] += change / shrunk[:, None]
        return None

    def stretch_by_tension(self, squares: FloatArray) -> FloatArray:
        """dλ/ds_a in 1/MPa at an equilibrium with its `squares`, shape (elements,); 0 where the fibre is held."""
        if self._free.start:
            return np.zeros(len(squares))
        right = np.broadcast_to(self._shares, squares.shape)[:, :, None]
        change = -np.linalg.solve(self._tangent(self._at(squares)), right)[:, 0, 0]
        return np.asarray(0.5 * change / np.sqrt(squares[:, 0]))

    def _tangent(self, at: Kinematics) -> FloatArray:
        """Derivative of the normal stresses by the squared stretches, shape (elements, 3, 3)."""
        # By half the change of the squared stretches, as the laws have it.
        return 0.5 * np.asarray(sum(law.tangent(at)[:, :3, :3] for law in self._laws))

    def _at(self, squares: FloatArray) -> Kinematics:
        diagonal = np.zeros((len(squares), 3, 3))
        inverse = np.zeros((len(squares), 3, 3))
        np.einsum("eii->ei", diagonal)[:] = squares
        np.einsum("eii->ei", inverse)[:] = 1.0 / squares
        return Kinematics(diagonal, inverse, 0.5 * np.log(squares).sum(axis=1), self._structure, self._sheet_structure)
