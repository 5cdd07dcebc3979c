"""Electrophysiology by arrival times: the eikonal equation gives the arrival of the wave, a cell's pulse follows it.

The outputs are those of the monodomain unit with Aliev–Panfilov cells. The unit is for scenes in which only the arrival
of the wave matters: a step solves no equations and may have any length. The speed of a plane wave is √(c d/(2β_t)) (1 −
2α), the closed form of the front for r = 0 (Nagumo; docs/model.md, Numbers). Before the activation potential is
crossed, the potential is that of the foot of the same front; afterwards, it is the action potential of a single cell.

How it fails: the unit neglects the curvature of the front and electrotonic currents, so that small stimuli start a wave
too early. The stretch has no influence, and so there is no such input. On coarse meshes, the speed is closer to that of
fine meshes than the speed of the monodomain unit is.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from .arrays import FloatArray, frozen
from .directions import FIBER_INPUT, check_directions
from .electrophysiology.ionic.aliev_panfilov import AlievPanfilov
from .electrophysiology.probes import PROBED, Probes
from .electrophysiology.progress import NOT_ACTIVATED
from .electrophysiology.stimulus import Stimulus
from .electrophysiology.time_scale import TimeScale
from .electrophysiology.unit import Electrophysiology, PotentialScale
from .errors import InvalidInput
from .mesh.arrival_times import arrival_times
from .snapshot import State
from .unit import Unit
from .variable import Causality, parameter

#: How long the pulse is followed, in units of β_t: by then the cell is at rest to a thousandth of a millivolt.
_PULSE = 100.0
_SAMPLES = 20001
#: How far before its crossing the front's foot is followed, in its own steepness: there φ is a millionth.
_FOOT = 14.0
#: Evaluations after which the pulse is given up; that of the default parameters takes 733.
_MOST_EVALUATIONS = 20_000


def _followed(rates: Callable[..., FloatArray], span: tuple[float, float], start: tuple[float, ...], **how: Any) -> Any:
    """The solution of an ordinary differential equation, shape (components, times); InvalidInput without one."""
    # Imported here: it takes long, and whoever has another unit does without.
    from scipy.integrate import solve_ivp

    evaluations = count()

    def counted(time: float, state: FloatArray) -> FloatArray:
        if next(evaluations) > _MOST_EVALUATIONS:
            raise _PulseLost
        return rates(time, state)

    try:
        with warnings.catch_warnings():
            # What LSODA warns of ends in a solution that is none.
            warnings.simplefilter("ignore")
            solution = solve_ivp(counted, span, start, method="LSODA", rtol=1e-8, **how)
    # SciPy refuses spans and states that are not finite.
    except (_PulseLost, ValueError):
        raise InvalidInput(_NO_PULSE) from None
    if not solution.success or not np.isfinite(solution.y).all():
        raise InvalidInput(_NO_PULSE)
    return solution.y


class _PulseLost(Exception):
    """The steps have become too short to reach the end."""


_NO_PULSE = "the action potential of a single cell cannot be computed with these parameters of the ionic model"


@dataclass(frozen=True)
class Spread:
    """How fast the wave is, along the fibre and across."""

    diffusion_isotropic_mm2_per_ms: float = parameter(1.0, "mm2/ms", "d_iso, isotropic diffusion", above=0.0)
    diffusion_anisotropic_mm2_per_ms: float = parameter(
        0.1, "mm2/ms", "d_ani, additional diffusion along the fibre", at_least=0.0
    )


class Eikonal(Unit):
    """Activation by the eikonal equation, followed by the pulse of the cell model."""

    name = "eikonal"
    groups = (PotentialScale, AlievPanfilov, Spread, TimeScale, Stimulus, Probes)
    fields = (
        FIBER_INPUT,
        *(
            replace(variable, depends_on=("fiber",))
            for variable in Electrophysiology.fields
            if variable.causality is Causality.OUTPUT
        ),
    )

    def prepare(self) -> None:
        """Compute all arrival times and the pulse; InvalidInput where the wave does not propagate."""
        fiber = self._inputs["fiber"]
        check_directions("fiber", fiber)
        self._scale = scale = self.parameters(PotentialScale)
        ionic, spread, stimulus = self.parameters(AlievPanfilov), self.parameters(Spread), self.parameters(Stimulus)
        self._time_scale = self.parameters(TimeScale)(self.mesh.points[:, 2])
        level = (scale.activation_potential_mV - scale.rest_potential_mV) / scale.potential_range_mV
        if not ionic.excitation_threshold < level < 1.0:
            raise InvalidInput("parameter 'activation_potential_mV' has to lie on the upstroke of the action potential")
        speed_squared = 0.5 * ionic.excitation_rate * (1.0 - 2.0 * ionic.excitation_threshold) ** 2
        across, along = spread.diffusion_isotropic_mm2_per_ms, spread.diffusion_anisotropic_mm2_per_ms
        diffusion = across * np.eye(3) + along * fiber[:, :, None] * fiber[:, None, :]
        rate = 1.0 / self._time_scale[self.mesh.cells].mean(axis=1)
        metric = np.linalg.inv(diffusion * (speed_squared * rate)[:, None, None])
        self._probes = self.parameters(Probes).places(self.mesh)
        # A stimulus below the threshold of excitation dies away.
        stimulated = (stimulus.stimulus_potential_mV - scale.rest_potential_mV) / scale.potential_range_mV
        released = np.where(stimulus.nodes(self.mesh.points) & (stimulated > ionic.excitation_threshold), 0.0, np.inf)
        self._arrival = arrival_times(self.mesh, metric, released)
        # Steepness of the front in time, by the closed form of its speed and width.
        self._steepness = 0.5 * ionic.excitation_rate * (1.0 - 2.0 * ionic.excitation_threshold)
        self._level = level
        # The recovery variable grows on the front's foot already, and exponentially from there: without it the
        # pulse is some ten milliseconds longer.
        recovered = _followed(
            lambda since, recovery: ionic.rates(self._foot(since), recovery)[1],
            (-_FOOT / self._steepness, 0.0),
            (0.0,),
            atol=1e-12,
        )[0, -1]
        self._moments = np.linspace(0.0, _PULSE, _SAMPLES)
        self._pulse = _followed(
            lambda _, state: np.array(ionic.rates(state[0], state[1])),
            (0.0, _PULSE),
            (level, recovered),
            t_eval=self._moments,
            atol=1e-10,
        )[0]

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The moment is all that changes."""
        return {"time": np.zeros(())}

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """The moment at the end of the step."""
        return {"time": np.asarray(time + step)}

    def output(self, name: str, state: State) -> FloatArray:
        """Potential in mV or activation time in ms, shape (nodes,); potential at a probe, a scalar."""
        if name in PROBED:
            return frozen(self._probes(self.output("potential", state))[PROBED.index(name)])
        now = float(state["time"])
        if name == "activation_time":
            values = np.where(self._arrival <= now, self._arrival, NOT_ACTIVATED)
        else:
            since = (now - self._arrival) / self._time_scale
            phi = np.where(since < 0.0, self._foot(since), np.interp(since, self._moments, self._pulse))
            values = self._scale.rest_potential_mV + self._scale.potential_range_mV * phi
        values.setflags(write=False)
        return values

    def _foot(self, since: FloatArray) -> FloatArray:
        """φ on the closed form's front, `since` its crossing of the activation potential in units of β_t."""
        return np.asarray(1.0 / (1.0 + (1.0 / self._level - 1.0) * np.exp(np.minimum(-self._steepness * since, 700.0))))
