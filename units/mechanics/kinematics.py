"""Deformation at the integration points, and the Voigt notation that the passive laws share."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import FloatArray

#: Order of the symmetric components in Voigt notation: 11, 22, 33, 12, 23, 13.
VOIGT_ROWS = (0, 1, 2, 0, 1, 0)
VOIGT_COLUMNS = (0, 1, 2, 1, 2, 2)

#: As indices of arrays, and those of two pairs; made once, for single elements are evaluated a thousand times.
_ROWS, _COLUMNS = np.array(VOIGT_ROWS), np.array(VOIGT_COLUMNS)
_I, _J, _K, _M = _ROWS[:, None], _COLUMNS[:, None], _ROWS[None], _COLUMNS[None]


def voigt(tensor: FloatArray) -> FloatArray:
    """Six components of symmetric tensors, shape (elements, 3, 3) to (elements, 6); shears once, as for stresses."""
    return tensor[:, _ROWS, _COLUMNS]


def dyad(left: FloatArray, right: FloatArray) -> FloatArray:
    """a⊗b of stress-like Voigt vectors, shape (elements, 6, 6)."""
    return left[:, :, None] * right[:, None, :]


def symmetric_product(tensor: FloatArray) -> FloatArray:
    """(X⊙X)_ijkl = ½(X_ik X_jl + X_il X_jk) of symmetric X, shape (elements, 3, 3) to (elements, 6, 6)."""
    return 0.5 * (tensor[:, _I, _K] * tensor[:, _J, _M] + tensor[:, _I, _M] * tensor[:, _J, _K])


def cofactors(tensor: FloatArray) -> FloatArray:
    """Cofactors of 3 × 3 matrices, shape (elements, 3, 3). Ten times as fast as a call of LAPACK per matrix."""
    rows = tensor.transpose(1, 0, 2)
    return np.stack([np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])], axis=1)


def determinant(tensor: FloatArray) -> FloatArray:
    """Determinants of 3 × 3 matrices, shape (elements,)."""
    return np.asarray(np.einsum("ei,ei->e", tensor[:, 0], np.cross(tensor[:, 1], tensor[:, 2])))


@dataclass(frozen=True)
class Kinematics:
    """What the strain energies depend on, for each integration point.

    `cauchy_green` C and its `inverse` have shape (points, 3, 3), `log_volume` ln J has shape (points,); `structure` is
    a₀⊗a₀ of the fibre and `sheet_structure` s₀⊗s₀ of the sheet, both of shape (points, 3, 3). J is positive: whoever
    builds this has checked. What several laws need of it is computed once.
    """

    cauchy_green: FloatArray
    inverse: FloatArray
    log_volume: FloatArray
    structure: FloatArray
    sheet_structure: FloatArray

    @classmethod
    def of(
        cls, gradient: FloatArray, volume_ratio: FloatArray, structure: FloatArray, sheet_structure: FloatArray
    ) -> "Kinematics":
        """From the deformation gradient F, shape (points, 3, 3), and J = det F > 0, shape (points,)."""
        cauchy_green = gradient.transpose(0, 2, 1) @ gradient
        inverse = cofactors(cauchy_green) / (volume_ratio**2)[:, None, None]
        return cls(cauchy_green, inverse, np.log(volume_ratio), structure, sheet_structure)

    @cached_property
    def fiber_stretch_squared(self) -> FloatArray:
        """I_a = a₀·C a₀, shape (elements,)."""
        return np.asarray(np.einsum("eij,eij->e", self.structure, self.cauchy_green))

    @cached_property
    def isochoric(self) -> FloatArray:
        """J^(−2/3), shape (elements,)."""
        return np.asarray(np.exp(-2.0 / 3.0 * self.log_volume))

    @cached_property
    def inverse_components(self) -> FloatArray:
        """C⁻¹ in Voigt notation, shape (elements, 6)."""
        return voigt(self.inverse)

    @cached_property
    def inverse_product(self) -> FloatArray:
        """C⁻¹⊙C⁻¹, shape (elements, 6, 6)."""
        return symmetric_product(self.inverse)


def square(direction: FloatArray) -> FloatArray:
    """d⊗d of directions, shape (elements, 3) to (elements, 3, 3)."""
    return direction[:, :, None] * direction[:, None, :]
