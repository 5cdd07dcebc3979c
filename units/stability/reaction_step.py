"""The explicit step of the ionic model: the longest substep that is stable for excited cells.

The ionic currents are taken explicitly by a method of second order with two stages (`electrophysiology.integration`),
which multiplies a disturbance that decays at the rate λ by |1 − λh + (λh)²/2|: below 1 where λh < 2. The fastest decay
of an action potential is back to its plateau. For Aliev–Panfilov cells it is c φ(2φ − 1 − α)/β_t on the branch that r
lowers, at most c(1 − α)/β_t: h < 2 β_t/(c(1 − α)) = 0.2525 β_t, 3.26 ms at β_t = 12.9 ms and 1.46 ms at 5.8 ms.

λ is computed: along the action potential of a cell, finely resolved, from the stimulus potential on; with the smallest
time scale of the scene's nodes.

What happens beyond: at λh = 2 the factor is +1, not −1 as forward Euler's, so that nothing oscillates. A second
resting point that the equation does not have takes over from the plateau: a wrong potential, with finite numbers, and
an action potential that lasts as long as it should within 3 %. At 0.3 β_t the plateau is 6 mV too low, at 0.4 β_t
15 mV; from 0.5 β_t on it jumps about; from 0.53 β_t on (3.1 ms at β_t = 5.8 ms, 6.8 ms at 12.9 ms) the numbers leave
what a cell reaches and the step fails. (Forward Euler has the same limit, and oscillates beyond it.)
"""

from functools import lru_cache
from typing import ClassVar

import numpy as np
from scipy.integrate import solve_ivp

from ..arrays import FloatArray
from ..electrophysiology.ionic.model import IonicModel
from ..electrophysiology.ionic.registry import IONIC_MODELS, IonicChoice
from ..electrophysiology.stimulus import Stimulus
from ..electrophysiology.time_scale import TimeScale
from ..electrophysiology.unit import PotentialScale, Resolution
from ..errors import InvalidInput
from .theory import Coupled, Setting, Theory

#: How long a pulse is followed, in fastest times of the model; places along it; half a difference for derivatives.
_FOLLOWED, _PLACES, _HALF = 400.0, 2000, 1e-6


class ReactionStep(Theory):
    """One unit `electrophysiology`: its substep against the fastest decay of its cells."""

    name: ClassVar[str] = "reaction_step"
    formula: ClassVar[str] = "h λ < 2, λ the fastest decay along the action potential, c(1 − α)/β_t"
    of_exchange: ClassVar[bool] = False

    def amplification(self, coupled: Coupled) -> float:
        """See Theory."""
        return two_stages(fastest_decay(coupled) * substep_ms(coupled))


def two_stages(decay: float) -> float:
    """By what a step of second order with two stages multiplies what decays by e^(−decay)."""
    return abs(1.0 - decay + 0.5 * decay * decay)


def substep_ms(coupled: Coupled) -> float:
    """The length of the substeps of `electrophysiology` in ms."""
    resolution = coupled.only("electrophysiology").group(Resolution)
    return coupled.step_ms / resolution.substeps(coupled.step_ms)


def fastest_decay(coupled: Coupled) -> float:
    """The fastest decay of the cells in 1/ms, where their time scale is smallest; InvalidInput without a scene."""
    setting = coupled.only("electrophysiology")
    if coupled.mesh is None:
        raise InvalidInput("the theory applies to tissue in a scene; add a `scene` to the scenario")
    ionic = setting.group(IONIC_MODELS[setting.group(IonicChoice).ionic_model])
    time_scale = setting.group(TimeScale)
    clock = time_scale if ionic.dimensionless_time else time_scale.relative
    return _decay(ionic, _stimulated(setting)) / float(clock(coupled.mesh().points[:, 2]).min())


def _stimulated(setting: Setting) -> float:
    """φ of stimulated cells."""
    scale = setting.group(PotentialScale)
    return (setting.group(Stimulus).stimulus_potential_mV - scale.rest_potential_mV) / scale.potential_range_mV


@lru_cache(maxsize=256)
def _decay(ionic: IonicModel, start: float) -> float:
    """The fastest decay along a pulse from φ = `start`, in the model's time."""

    def rates(_: float, values: FloatArray) -> FloatArray:
        return np.stack(ionic.rates(*values))

    begin = np.array([start, *(float(state) for state in ionic.initial(np.asarray(start)))])
    end = _FOLLOWED * ionic.longest_step
    places = np.linspace(0.0, end, _PLACES)
    solution = solve_ivp(rates, (0.0, end), begin, "LSODA", places, rtol=1e-8, atol=1e-10)
    course = solution.y
    if not solution.success or not np.isfinite(course).all():
        raise InvalidInput("the ionic model has no action potential with these parameters")
    jacobians = np.empty((course.shape[1], len(begin), len(begin)))
    for column, nudge in enumerate(_HALF * np.eye(len(begin))):
        above, below = rates(0.0, course + nudge[:, None]), rates(0.0, course - nudge[:, None])
        jacobians[:, :, column] = ((above - below) / (2.0 * _HALF)).T
    return float(-np.linalg.eigvals(jacobians).real.min())
