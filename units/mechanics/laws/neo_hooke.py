"""The isotropic part of the strain energy: a compressible neo-Hookean solid (docs/model.md, Mechanics).

    W = ½μ(I₁ − 3) ∓ μ ln J + ½λ_L (ln J)²

`stress_free` has the minus sign: S = μ(1 − C⁻¹) + λ_L ln J C⁻¹ vanishes at F = 1. `as_printed` has the plus sign,
by which the undeformed tissue carries the stress 2μ and has no equilibrium to start from.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...arrays import FloatArray
from ...variable import parameter
from ..kinematics import Kinematics, dyad


@dataclass(frozen=True)
class NeoHooke:
    """Lamé parameters of the isotropic part."""

    name: ClassVar[str] = "neo_hooke"

    shear_modulus_MPa: float = parameter(0.2, "MPa", "mu, shear modulus", above=0.0)
    lame_lambda_MPa: float = parameter(0.5, "MPa", "lambda_L, first Lame parameter", above=0.0)
    neo_hooke_log_sign: str = parameter(
        "stress_free",
        "1",
        "sign of mu ln J: stress_free (minus), or as_printed (plus: no stress-free state)",
        choices=("stress_free", "as_printed"),
    )

    @property
    def _log_modulus(self) -> float:
        return -self.shear_modulus_MPa if self.neo_hooke_log_sign == "as_printed" else self.shear_modulus_MPa

    @property
    def modulus(self) -> float:
        """See Law."""
        return self.shear_modulus_MPa

    def constants(self) -> tuple[float, ...]:
        """See Law."""
        return self.shear_modulus_MPa, self.lame_lambda_MPa, self._log_modulus

    def energy(self, at: Kinematics) -> FloatArray:
        """W in MPa, shape (elements,)."""
        first = np.trace(at.cauchy_green, axis1=1, axis2=2) - 3.0
        return np.asarray(
            0.5 * self.shear_modulus_MPa * first
            - self._log_modulus * at.log_volume
            + 0.5 * self.lame_lambda_MPa * at.log_volume**2
        )

    def stress(self, at: Kinematics) -> FloatArray:
        """S = 2∂W/∂C in MPa, shape (elements, 3, 3)."""
        on_inverse = self.lame_lambda_MPa * at.log_volume - self._log_modulus
        return self.shear_modulus_MPa * np.eye(3) + on_inverse[:, None, None] * at.inverse

    def tangent(self, at: Kinematics) -> FloatArray:
        """4∂²W/∂C² in MPa, Voigt notation, shape (elements, 6, 6)."""
        inverse = at.inverse_components
        on_product = 2.0 * (self._log_modulus - self.lame_lambda_MPa * at.log_volume)
        return self.lame_lambda_MPa * dyad(inverse, inverse) + on_product[:, None, None] * at.inverse_product
