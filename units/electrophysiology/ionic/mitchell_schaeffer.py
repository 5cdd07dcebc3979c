"""The Mitchell–Schaeffer ionic model (2003): an inward current behind one gate, and an outward current.

With φ = (Φ − Φ_rest)/β_φ, the gate h, and time in ms (Bull. Math. Biol. 65, 767–793, eqs. 2.1–2.4):

    ∂φ/∂t = h φ²(1 − φ)/τ_in − φ/τ_out
    ∂h/∂t = (1 − h)/τ_open where φ < φ_gate, else −h/τ_close

To leading order in τ_in, τ_out ≪ τ_open, τ_close a rested cell's action potential lasts τ_close ln(τ_out/(4 τ_in)): the
plateau ends where the gate has closed to 4 τ_in/τ_out.

How it fails: the gate's rate jumps at φ_gate, so that a step that crosses it is of first order in time.
"""

from dataclasses import astuple, dataclass
from typing import ClassVar

import numpy as np

from ...arrays import FloatArray
from ...variable import parameter


@dataclass(frozen=True)
class MitchellSchaeffer:
    """Parameters of the ionic model; the defaults are the paper's."""

    name: ClassVar[str] = "mitchell_schaeffer"
    states: ClassVar[tuple[str, ...]] = ("gate",)
    dimensionless_time: ClassVar[bool] = False
    kernel: ClassVar[str | None] = "mitchell_schaeffer"

    inward_time_ms: float = parameter(0.3, "ms", "tau_in, time constant of the inward current", above=0.0)
    outward_time_ms: float = parameter(6.0, "ms", "tau_out, time constant of the outward current", above=0.0)
    gate_opening_time_ms: float = parameter(120.0, "ms", "tau_open, time in which the gate opens", above=0.0)
    gate_closing_time_ms: float = parameter(150.0, "ms", "tau_close, time in which the gate closes", above=0.0)
    gate_threshold: float = parameter(
        0.13, "1", "phi_gate, dimensionless potential at which the gate turns round", above=0.0, below=1.0
    )

    def initial(self, phi: FloatArray) -> tuple[FloatArray, ...]:
        """An open gate."""
        return (np.ones_like(phi),)

    def rates(self, phi: FloatArray, gate: FloatArray) -> tuple[FloatArray, ...]:
        """∂φ/∂t and ∂h/∂t in 1/ms, shapes as given."""
        current = gate * phi * phi * (1.0 - phi) / self.inward_time_ms - phi / self.outward_time_ms
        closing = -gate / self.gate_closing_time_ms
        return current, np.where(phi < self.gate_threshold, (1.0 - gate) / self.gate_opening_time_ms, closing)

    @property
    def constants(self) -> tuple[float, ...]:
        """See IonicModel."""
        return astuple(self)

    @property
    def longest_step(self) -> float:
        """Half the stability limit of the fastest rate: 1/τ_in + 1/τ_out, that of φ at φ = h = 1, or a gate's."""
        excitation = 1.0 / self.inward_time_ms + 1.0 / self.outward_time_ms
        return 1.0 / max(excitation, 1.0 / self.gate_opening_time_ms, 1.0 / self.gate_closing_time_ms)

    @property
    def lowest_phi(self) -> float:
        """None."""
        return -np.inf

    @property
    def lowest_phi_reason(self) -> str:
        """See IonicModel."""
        return ""
