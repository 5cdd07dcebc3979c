"""A damped mass on a spring, coupled to another mass through a spring and a damper: half of the two-mass oscillator.

    m x″ + (c + c_c) x′ + (k + k_c) x = F_in + k_c x_in + c_c v_in,   F = k_c (x − x_in) + c_c (x′ − v_in)

The two-mass oscillator is the benchmark of co-simulation (Busch 2012; Schweizer, Li & Lu 2015). Two masses are coupled
in one of two ways. By force and displacement: the second mass receives x and v of the first and returns F, the force of
the coupling on the first (`second.F -> first.F_in`); the first mass has no k_c and c_c. By displacement and
displacement: both masses have k_c and c_c, and each receives x and v of the other. An FMU from elsewhere that has the
same equation and names can replace a mass.

The step is exact for inputs that are held or vary linearly over it; it uses the exponential of the matrix that contains
the equation and its load. The numbers may be in any consistent units of measure with the second as that of time.

How it fails: the unit itself does not fail. If the coupling is unstable, the values grow until they are no longer
finite numbers.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from ..arrays import FloatArray
from ..differentiable import Differentiable
from ..snapshot import State
from ..taken import Taken
from ..variable import Causality, Record, Variable, parameter
from .scalar_derivative import ScalarDerivative

_MS_PER_S = 1000.0


@dataclass(frozen=True)
class Suspension:
    """A mass, the spring and damper that hold it, and those that couple it to another."""

    m: float = parameter(1.0, "1", "mass", above=0.0)
    k: float = parameter(0.0, "1", "stiffness of the spring that holds the mass", at_least=0.0)
    c: float = parameter(0.0, "1", "damping of the mass", at_least=0.0)
    k_c: float = parameter(0.0, "1", "stiffness of the spring of the coupling", at_least=0.0)
    c_c: float = parameter(0.0, "1", "damping of the coupling", at_least=0.0)

    def load(self, force: FloatArray, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """The force that the inputs F_in, x_in and v_in exert, of any shape."""
        return np.asarray(force + self.k_c * position + self.c_c * velocity)

    def reaction(self, x: FloatArray, v: FloatArray, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """F, with which the coupling pulls at what x_in and v_in are of."""
        return np.asarray(self.k_c * (x - position) + self.c_c * (v - velocity))

    def propagator(self, step_s: float) -> FloatArray:
        """From x, v, the load and its first and second time derivatives to x and v after `step_s`; shape (2, 5)."""
        return _propagator(self.m, self.k + self.k_c, self.c + self.c_c, step_s)


@dataclass(frozen=True)
class Release:
    """Where the mass is at the start, and how fast."""

    x_start: float = parameter(0.0, "1", "displacement at the start")
    v_start: float = parameter(0.0, "1", "velocity at the start")


class Mass(Differentiable):
    """A damped mass on a spring, coupled to another through a spring and a damper."""

    name = "mass"
    interpolates = True
    groups = (Suspension, Release)
    fields = (
        Variable("F_in", Causality.INPUT, "1", "force on the mass"),
        Variable("x_in", Causality.INPUT, "1", "displacement at the other end of the coupling"),
        Variable("v_in", Causality.INPUT, "1", "velocity at the other end of the coupling"),
        Variable(
            "x",
            Causality.OUTPUT,
            "1",
            "displacement of the mass",
            depends_on=("F_in", "x_in", "v_in"),
            record=Record.VALUE,
        ),
        Variable(
            "v", Causality.OUTPUT, "1", "velocity of the mass", depends_on=("F_in", "x_in", "v_in"), record=Record.VALUE
        ),
        Variable(
            "F",
            Causality.OUTPUT,
            "1",
            "force of the coupling on its other end",
            depends_on=("F_in", "x_in", "v_in"),
            record=Record.VALUE,
        ),
    )

    def prepare(self) -> None:
        """Take the parameters."""
        self._suspension = self.parameters(Suspension)

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The mass as it is released."""
        release = self.parameters(Release)
        return self._state_of(np.array([release.x_start, release.v_start]), inputs)

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Exact for inputs on a line; a step of zero length lets the force follow the inputs."""
        motion = state["motion"]
        if step > 0.0:
            step_s = step / _MS_PER_S
            first, last = self._load(begin), self._load(inputs)
            loads = np.stack([first, (last - first) / step_s])
            motion = self._suspension.propagator(step_s)[:, :4] @ np.concatenate([motion, loads])
        return self._state_of(motion, inputs)

    def derivative(self, taken: Taken, state: State) -> ScalarDerivative:
        """See Differentiable. Both ends of an input move, so that the load moves and its slope stays."""
        by_load = self._suspension.propagator(taken.step / _MS_PER_S)[:, 2] if taken.step > 0.0 else np.zeros(2)
        inputs = np.eye(3)
        x, v = by_load[:, None] * self._suspension.load(*inputs)
        force = self._suspension.reaction(x, v, inputs[1], inputs[2])
        names = [variable.name for variable in self.inputs()]
        rows = {"x": x, "v": v, "F": force}
        return ScalarDerivative({name: dict(zip(names, row.tolist(), strict=True)) for name, row in rows.items()})

    def output(self, name: str, state: State) -> FloatArray:
        """A scalar."""
        return state["force"] if name == "F" else state["motion"][("x", "v").index(name)]

    def _load(self, inputs: State) -> FloatArray:
        return self._suspension.load(inputs["F_in"], inputs["x_in"], inputs["v_in"])

    def _state_of(self, motion: FloatArray, inputs: State) -> dict[str, FloatArray]:
        force = self._suspension.reaction(motion[0], motion[1], inputs["x_in"], inputs["v_in"])
        return {"motion": motion, "force": force}


@lru_cache(maxsize=64)
def _propagator(mass: float, stiffness: float, damping: float, step_s: float) -> FloatArray:
    matrix = np.zeros((5, 5))
    matrix[0, 1] = 1.0
    matrix[1, :3] = [-stiffness / mass, -damping / mass, 1.0 / mass]
    # The load is the integral of its slope, and that of its curvature.
    matrix[2, 3] = matrix[3, 4] = 1.0
    propagator = np.asarray(expm(step_s * matrix)[:2])
    propagator.setflags(write=False)
    return propagator
