"""The stretch beyond which resting tissue fires by itself, lifted over its threshold by the stretch-activated current.

Without recovery a cell under the stretch λ rests where c φ (φ − α)(φ − 1) = G_s (λ − 1)(φ_s − φ). The left side has a
maximum between rest and the threshold α; where the right side is above it everywhere, there is no state of rest, and
the cell fires. For small α that is G_s (λ − 1) > c α²/(4 φ_s), with the parameters of the heart λ − 1 > 3.3e-5
(docs/model.md, Numbers). Stretches that are wrong by so much, from an equilibrium that is not solved well enough, start
beats.
"""

from typing import ClassVar

from scipy.optimize import minimize_scalar

from ..electrophysiology.ionic.aliev_panfilov import AlievPanfilov
from ..electrophysiology.monodomain import Conduction
from ..errors import InvalidInput
from ..test_problems.response import Response
from .theory import Coupled, Theory


class RestingTissue(Theory):
    """A cell that is stretched by the `offset` of a `response`, which is λ − 1."""

    name: ClassVar[str] = "resting_tissue"
    formula: ClassVar[str] = "G_s (λ − 1) < max c φ (φ − α)(φ − 1)/(φ_s − φ), about c α²/(4 φ_s)"
    of_exchange: ClassVar[bool] = False

    def amplification(self, coupled: Coupled) -> float:
        """G_s (λ − 1) over its largest value with a state of rest. InvalidInput for another ionic model."""
        unit = coupled.only("electrophysiology")
        if unit.parameters["ionic_model"] != AlievPanfilov.name:
            raise InvalidInput("the theory resting_tissue applies to the ionic model aliev_panfilov")
        ionic, conduction = unit.group(AlievPanfilov), unit.group(Conduction)
        beyond = float(coupled.only(Response.name).parameters["offset"])

        def current(phi: float) -> float:
            """By how much the cell's own current outweighs a unit of stretch current."""
            own = ionic.excitation_rate * phi * (phi - ionic.excitation_threshold) * (phi - 1.0)
            return float(own / (conduction.stretch_reversal - phi))

        bounds = (0.0, ionic.excitation_threshold)
        found = minimize_scalar(lambda phi: -current(phi), bounds=bounds, method="bounded", options={"xatol": 1e-10})
        return conduction.stretch_conductance * max(beyond, 0.0) / -float(found.fun)
