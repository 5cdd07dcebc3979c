"""The Aliev–Panfilov ionic model: two dimensionless variables per point.

With φ = (Φ − Φ_rest)/β_φ and τ = t/β_t (docs/model.md, Electrophysiology; Göktepe & Kuhl 2010; Nash & Panfilov 2004):

    ∂φ/∂τ = −Ĩ_e,  Ĩ_e = cφ(φ − α)(φ − 1) + rφ
    ∂r/∂τ = (γ + μ₁ r/(μ₂ + φ)) (−r − cφ(φ − b − 1))

The recovery rate has a pole at φ = −μ₂ (−110 mV). An explicit step can jump over it and come back with plausible
numbers, so whoever advances the model has to watch that φ stays above.
"""

from dataclasses import astuple, dataclass
from typing import ClassVar

import numpy as np

from ...arrays import FloatArray
from ...variable import parameter


@dataclass(frozen=True)
class AlievPanfilov:
    """Parameters of the ionic model, all dimensionless (Göktepe & Kuhl 2010)."""

    name: ClassVar[str] = "aliev_panfilov"
    states: ClassVar[tuple[str, ...]] = ("recovery",)
    dimensionless_time: ClassVar[bool] = True
    kernel: ClassVar[str | None] = "aliev_panfilov"

    excitation_rate: float = parameter(8.0, "1", "c, strength of the excitation current", above=0.0)
    excitation_threshold: float = parameter(0.01, "1", "alpha, threshold of excitation", at_least=0.0, below=0.5)
    recovery_rate: float = parameter(0.002, "1", "gamma, base rate of recovery", at_least=0.0)
    recovery_mu1: float = parameter(0.2, "1", "mu_1, weight of the state-dependent recovery rate", at_least=0.0)
    recovery_mu2: float = parameter(0.3, "1", "mu_2, offset of the state-dependent recovery rate", above=0.0)
    recovery_offset: float = parameter(0.15, "1", "b, offset of the recovery's target", at_least=0.0)

    def initial(self, phi: FloatArray) -> tuple[FloatArray, ...]:
        """r = 0."""
        return (np.zeros_like(phi),)

    def rates(self, phi: FloatArray, recovery: FloatArray) -> tuple[FloatArray, ...]:
        """∂φ/∂τ and ∂r/∂τ without diffusion and stretch current, shapes as given."""
        current = phi * (self.excitation_rate * (phi - self.excitation_threshold) * (phi - 1.0) + recovery)
        rate = self.recovery_rate + self.recovery_mu1 * recovery / (self.recovery_mu2 + phi)
        target = -self.excitation_rate * phi * (phi - self.recovery_offset - 1.0)
        return -current, rate * (target - recovery)

    @property
    def longest_step(self) -> float:
        """Dimensionless step below which an explicit step of second order resolves the fastest rate and is stable."""
        return 1.0 / self.excitation_rate

    @property
    def constants(self) -> tuple[float, ...]:
        """See IonicModel."""
        return astuple(self)

    @property
    def lowest_phi(self) -> float:
        """−μ₂."""
        return -self.recovery_mu2

    @property
    def lowest_phi_reason(self) -> str:
        """See IonicModel."""
        return "the pole of the ionic model's recovery rate"
