"""The fibre part of the strain energy, in tension only (Holzapfel–Gasser–Ogden; docs/model.md, Mechanics).

    W_f = k₁/(2k₂) (exp(k₂ (Ī_a − 1)²) − 1) for Ī_a > 1, else 0,   Ī_a = J^(−2/3) a₀·C a₀

The stress is continuous where the fibre goes slack, the tangent jumps there from 4k₁ to 0.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...arrays import FloatArray
from ...variable import parameter
from ..kinematics import Kinematics, dyad, voigt


@dataclass(frozen=True)
class HolzapfelFiber:
    """Stiffness of the fibres."""

    name: ClassVar[str] = "holzapfel_fiber"

    fiber_stiffness_MPa: float = parameter(0.001685, "MPa", "k_1, stiffness of the fibres", at_least=0.0)
    fiber_exponent: float = parameter(15.779, "1", "k_2, stiffening of the fibres", above=0.0)

    @property
    def modulus(self) -> float:
        """See Law."""
        return self.fiber_stiffness_MPa

    def constants(self) -> tuple[float, ...]:
        """See Law."""
        return self.fiber_stiffness_MPa, self.fiber_exponent

    def energy(self, at: Kinematics) -> FloatArray:
        """W_f in MPa, shape (elements,)."""
        extension = self._extension(at)
        growth = np.expm1(self.fiber_exponent * extension**2)
        return np.asarray(0.5 * self.fiber_stiffness_MPa / self.fiber_exponent * growth)

    def stress(self, at: Kinematics) -> FloatArray:
        """S = 2∂W_f/∂C in MPa, shape (elements, 3, 3)."""
        first, _ = self._derivatives(self._extension(at))
        return 2.0 * first[:, None, None] * self._invariant_gradient(at)

    def tangent(self, at: Kinematics) -> FloatArray:
        """4∂²W_f/∂C² in MPa, Voigt notation, shape (elements, 6, 6)."""
        first, second = self._derivatives(self._extension(at))
        gradient = voigt(self._invariant_gradient(at))
        structure, inverse = voigt(at.structure), at.inverse_components
        squared = at.fiber_stretch_squared[:, None, None]
        curvature = (
            -(dyad(structure, inverse) + dyad(inverse, structure)) / 3.0
            + squared / 9.0 * dyad(inverse, inverse)
            + squared / 3.0 * at.inverse_product
        )
        on_curvature = (first * at.isochoric)[:, None, None]
        return 4.0 * (second[:, None, None] * dyad(gradient, gradient) + on_curvature * curvature)

    def _extension(self, at: Kinematics) -> FloatArray:
        return np.maximum(at.isochoric * at.fiber_stretch_squared - 1.0, 0.0)

    def _derivatives(self, extension: FloatArray) -> tuple[FloatArray, FloatArray]:
        growth = self.fiber_stiffness_MPa * np.exp(self.fiber_exponent * extension**2)
        second = growth * (1.0 + 2.0 * self.fiber_exponent * extension**2)
        return growth * extension, np.where(extension > 0.0, second, 0.0)

    @staticmethod
    def _invariant_gradient(at: Kinematics) -> FloatArray:
        """∂Ī_a/∂C, shape (elements, 3, 3)."""
        return np.asarray(
            at.isochoric[:, None, None] * (at.structure - at.fiber_stretch_squared[:, None, None] / 3.0 * at.inverse)
        )
