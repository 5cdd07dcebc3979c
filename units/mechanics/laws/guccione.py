"""Guccione's transversely isotropic law, nearly incompressible by a penalty (Guccione, McCulloch & Waldman 1991).

    W = ½C (exp Q − 1) + ¼κ (J² − 1 − 2 ln J)
    Q = b_f E_ff² + b_t (E_ss² + E_nn² + 2E_sn²) + 2b_fs (E_fs² + E_fn²)
      = (b_f + b_t − 2b_fs)(a₀·E a₀)² + b_t E:E + 2(b_fs − b_t)|E a₀|²,   E = ½(C − 1)

By the second form of Q the fibre is all that it needs. The numbers by default are those of the beam in the benchmark of
Land et al. 2015; fitted ones of living tissue are stiffer along the fibre.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...arrays import FloatArray
from ...variable import parameter
from ..kinematics import Kinematics, dyad, symmetric_product, voigt


@dataclass(frozen=True)
class Guccione:
    """Stiffness, its shares along, across and between, and resistance against a change of volume."""

    name: ClassVar[str] = "guccione"

    guccione_stiffness_MPa: float = parameter(0.002, "MPa", "C, stiffness of Guccione's law", above=0.0)
    guccione_fiber: float = parameter(8.0, "1", "b_f, along the fibre", at_least=0.0)
    guccione_transverse: float = parameter(2.0, "1", "b_t, across the fibre", above=0.0)
    guccione_shear: float = parameter(4.0, "1", "b_fs, in shear between the fibre and its normals", above=0.0)
    guccione_bulk_modulus_MPa: float = parameter(
        0.5, "MPa", "kappa, penalty of Guccione's law on a change of volume", above=0.0
    )

    @property
    def modulus(self) -> float:
        """See Law."""
        return 0.5 * self.guccione_stiffness_MPa * max(self.guccione_transverse, self.guccione_shear)

    def constants(self) -> tuple[float, ...]:
        """See Law."""
        return self.guccione_stiffness_MPa, *self._shares, self.guccione_bulk_modulus_MPa

    def energy(self, at: Kinematics) -> FloatArray:
        """W in MPa, shape (points,)."""
        exponent = self._exponent(at)[0]
        volumetric = np.expm1(2.0 * at.log_volume) - 2.0 * at.log_volume
        return np.asarray(
            0.5 * self.guccione_stiffness_MPa * np.expm1(exponent) + 0.25 * self.guccione_bulk_modulus_MPa * volumetric
        )

    def stress(self, at: Kinematics) -> FloatArray:
        """S = ∂W/∂E in MPa, shape (points, 3, 3)."""
        exponent, slope = self._exponent(at)
        growth = 0.5 * self.guccione_stiffness_MPa * np.exp(exponent)
        pressure = 0.5 * self.guccione_bulk_modulus_MPa * np.expm1(2.0 * at.log_volume)
        return growth[:, None, None] * slope + pressure[:, None, None] * at.inverse

    def tangent(self, at: Kinematics) -> FloatArray:
        """∂²W/∂E² in MPa, Voigt notation, shape (points, 6, 6)."""
        exponent, slope = self._exponent(at)
        on_fiber, on_all, on_shear = self._shares
        gradient, structure, inverse = voigt(slope), voigt(at.structure), at.inverse_components
        eye = np.broadcast_to(np.eye(3), slope.shape)
        # A dE + dE A is what the product of 1 + A with itself has beyond those of 1 and of A.
        mixed = symmetric_product(eye + at.structure) - symmetric_product(eye) - symmetric_product(at.structure)
        curvature = (
            2.0 * on_fiber * dyad(structure, structure) + 2.0 * on_all * symmetric_product(eye) + on_shear * mixed
        )
        growth = 0.5 * self.guccione_stiffness_MPa * np.exp(exponent)
        squared = np.exp(2.0 * at.log_volume)
        return np.asarray(
            growth[:, None, None] * (dyad(gradient, gradient) + curvature)
            + (self.guccione_bulk_modulus_MPa * squared)[:, None, None] * dyad(inverse, inverse)
            - (self.guccione_bulk_modulus_MPa * (squared - 1.0))[:, None, None] * at.inverse_product
        )

    @property
    def _shares(self) -> tuple[float, float, float]:
        """The factors of (a₀·E a₀)², E:E and |E a₀|² in Q."""
        fiber, transverse, shear = self.guccione_fiber, self.guccione_transverse, self.guccione_shear
        return fiber + transverse - 2.0 * shear, transverse, 2.0 * (shear - transverse)

    def _exponent(self, at: Kinematics) -> tuple[FloatArray, FloatArray]:
        """Q, shape (points,), and ∂Q/∂E, shape (points, 3, 3); Q is half of ∂Q/∂E : E."""
        on_fiber, on_all, on_shear = self._shares
        strain = 0.5 * (at.cauchy_green - np.eye(3))
        along = np.einsum("pij,pij->p", at.structure, strain)
        product = at.structure @ strain
        slope = 2.0 * on_fiber * along[:, None, None] * at.structure + 2.0 * on_all * strain
        slope += on_shear * (product + product.transpose(0, 2, 1))
        return np.asarray(0.5 * np.einsum("pij,pij->p", slope, strain)), slope
