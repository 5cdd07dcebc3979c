"""The active stress unit: the tension that a depolarised cell builds up with a delay, at every node independently.

    ∂s_a/∂t = ε(Φ)(k(Φ − Φ_r) − s_a),   ε = ε₀ + (ε₁ − ε₀) exp(−exp(−ζ(Φ − Φ_t)))

The input is the transmembrane potential, held over a step or varying linearly, and optionally the stretch. The output
is s_a in kPa. Source: docs/model.md, Active stress; Göktepe & Kuhl 2010, eq. 46. For a held potential, the step is
exact and may have any length. With `time_integration: forward_euler` a step of length H gives
s_a + H ε (k(Φ − Φ_r) − s_a) with the potential at its end. This oscillates with growing amplitude where
ε₁ H > 2; the option exists to show that limit.

If the potential varies linearly over a step, each node is treated as if its potential jumped from the value at the
beginning to the value at the end, at a moment that is evenly distributed over the step. The mean potential is then the
line between the two values. The mean active stress is known in closed form and has second order of accuracy. To let
every node follow the line itself would be as accurate for a slow potential and less accurate for a fast one: an
upstroke takes one millisecond, and it passes the threshold of the delay somewhere in the step, not always near its end.

With `length_dependence` η the output is s_a (1 + η(λ − 1)), where λ is averaged by volume over the elements around a
node (Frank–Starling). Active stress and mechanics then form an algebraic loop. For a stable coupling, the unit also
provides the active stiffness K_a = ∂s_a/∂λ = s_a η and the stretch at which both apply (Regazzoni & Quarteroni 2021).

How it fails: the delay function as printed in the source document (`delay_function: as_printed`), ε₀ + (ε₀ − ε₁)
exp(…), is negative in depolarised tissue, so that the active stress moves away from its target instead of towards it. A
relaxation rate that is not positive ends the step with StepFailure.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import exprel

from .active_stress_derivative import ActiveStressDerivative, held_slope, ramped_slope
from .arrays import FloatArray, frozen
from .differentiable import Differentiable
from .errors import StepFailure
from .mesh.averages import around_nodes
from .snapshot import State
from .taken import Taken
from .variable import VOLTAGE, Causality, Location, Record, Variable, parameter

_KPA_PER_MPA = 1000.0

#: Two hundred times what muscle builds up.
_LARGEST_KPA = 1e5


@dataclass(frozen=True)
class Tension:
    """Target and delay of the active stress (Göktepe & Kuhl 2010)."""

    tension_per_potential_MPa_per_mV: float = parameter(0.005, "MPa/mV", "k, active stress per potential", at_least=0.0)
    tension_rest_potential_mV: float = parameter(-80.0, "mV", "Phi_r, potential without active stress", **VOLTAGE)
    tension_threshold_potential_mV: float = parameter(
        0.0, "mV", "Phi_t, potential at which the delay changes", **VOLTAGE
    )
    slow_rate_per_ms: float = parameter(0.1, "1/ms", "epsilon_0, rate of the delay at rest", above=0.0)
    fast_rate_per_ms: float = parameter(1.0, "1/ms", "epsilon_1, rate of the delay when depolarised", above=0.0)
    delay_slope_per_mV: float = parameter(1.0, "1/mV", "zeta, steepness of the delay function", above=0.0)
    delay_function: str = parameter(
        "gompertz",
        "1",
        "gompertz: eps_0 + (eps_1 - eps_0) exp(-exp(..)); as_printed: eps_0 + (eps_0 - eps_1) exp(-exp(..)), unstable",
        choices=("gompertz", "as_printed"),
    )
    length_dependence: float = parameter(0.0, "1", "eta, relative active stress per stretch (Frank-Starling)")
    time_integration: str = parameter(
        "exact",
        "1",
        "exact: exact solution for a held potential, for any step; forward_euler: explicit, unstable where eps_1 times "
        "the step exceeds 2",
        choices=("exact", "forward_euler"),
    )

    def rate(self, potential: FloatArray) -> FloatArray:
        """ε in 1/ms at the potentials (mV)."""
        return np.asarray(self.slow_rate_per_ms + self._jump * np.exp(-np.exp(self._exponent(potential))))

    def rate_slope(self, potential: FloatArray) -> FloatArray:
        """dε/dΦ in 1/(ms mV) at the potentials (mV)."""
        exponent = self._exponent(potential)
        return np.asarray(self._jump * self.delay_slope_per_mV * np.exp(exponent - np.exp(exponent)))

    def target(self, potential: FloatArray) -> FloatArray:
        """k(Φ − Φ_r) in MPa."""
        return self.tension_per_potential_MPa_per_mV * (potential - self.tension_rest_potential_mV)

    @property
    def _jump(self) -> float:
        jump = self.fast_rate_per_ms - self.slow_rate_per_ms
        return -jump if self.delay_function == "as_printed" else jump

    def _exponent(self, potential: FloatArray) -> FloatArray:
        exponent = -self.delay_slope_per_mV * (potential - self.tension_threshold_potential_mV)
        # exp(-exp(x)) is 0 to the last bit from x = 7 on; capping x keeps exp from overflowing far below threshold.
        return np.minimum(exponent, 50.0)


class ActiveStress(Differentiable):
    """Active stress by a potential-dependent first-order delay."""

    name = "active_stress"
    interpolates = True
    groups = (Tension,)
    fields = (
        Variable("potential", Causality.INPUT, "mV", "transmembrane potential", Location.NODE, start=-80.0),
        Variable(
            "stretch",
            Causality.INPUT,
            "1",
            "stretch along the fibre",
            Location.ELEMENT,
            start=1.0,
            above=0.0,
            needs="length_dependence",
        ),
        Variable(
            "active_stress",
            Causality.OUTPUT,
            "kPa",
            "active stress along the fibre",
            Location.NODE,
            depends_on=("potential", "stretch"),
            pointwise=True,
            mean_record=Record.VALUE,
        ),
        Variable(
            "active_stiffness",
            Causality.OUTPUT,
            "kPa",
            "derivative of the active stress with respect to the stretch",
            Location.NODE,
            depends_on=("potential",),
            pointwise=True,
            needs="length_dependence",
        ),
        Variable(
            "reference_stretch",
            Causality.OUTPUT,
            "1",
            "stretch at which active stress and active stiffness apply; 0 without length dependence",
            Location.ELEMENT,
            depends_on=("stretch",),
            pointwise=True,
            needs="length_dependence",
        ),
    )

    def prepare(self) -> None:
        """Set up the average of the stretch around a node, where it is needed."""
        self._tension = self.parameters(Tension)
        if self._tension.length_dependence:
            self._average = around_nodes(self.mesh.cells, self.mesh.volumes)

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """No active stress, whatever the potential."""
        nothing = np.zeros(self.mesh.nodes)
        return {"tension": nothing, "active_stress": nothing, **self._reference(inputs)}

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """The exact solution for a held potential, or its mean over the moments at which the potential may change.

        With forward Euler it is one explicit step. StepFailure where the delay's rate is not positive.
        """
        first, last, tension = begin["potential"], inputs["potential"], state["tension"]
        decay = self._rate(last) * step
        target = self._tension.target(last)
        if self._tension.time_integration == "forward_euler":
            tension = tension + decay * (target - tension)
        elif np.array_equal(first, last):
            tension = tension - (target - tension) * np.expm1(-decay)
        else:
            earlier_decay, earlier_target = self._rate(first) * step, self._tension.target(first)
            slower = np.minimum(decay, earlier_decay)
            tension = (
                target
                + (earlier_target - target) * exprel(-decay)
                + (tension - earlier_target) * np.exp(-slower) * exprel(-abs(decay - earlier_decay))
            )
        active_stress = _KPA_PER_MPA * tension * self._length_factor(inputs["stretch"])
        if not np.abs(active_stress).max() <= _LARGEST_KPA:
            node = int(np.abs(active_stress).argmax())
            raise StepFailure(
                f"the active stress at node {node} is {active_stress[node]:.3g} kPa, more than any tissue bears"
            )
        return {"tension": tension, "active_stress": active_stress, **self._reference(inputs)}

    def derivative(self, taken: Taken, state: State) -> ActiveStressDerivative:
        """See Differentiable; initially there is no active stress, whatever the inputs."""
        eta = self._tension.length_dependence
        return ActiveStressDerivative(
            _KPA_PER_MPA * (self._slope(taken) if taken.before else np.zeros(self.mesh.nodes)),
            np.ones(self.mesh.nodes) * self._length_factor(taken.inputs["stretch"]),
            _KPA_PER_MPA * eta * state["tension"],
            eta,
            self._average if eta else None,
        )

    def output(self, name: str, state: State) -> FloatArray:
        """Active stress and its stiffness in kPa, shape (nodes,), and the stretch they hold at, shape (elements,)."""
        if name == "active_stiffness":
            return frozen(_KPA_PER_MPA * self._tension.length_dependence * state["tension"])
        if name == "reference_stretch" and not self._tension.length_dependence:
            return frozen(np.zeros(self.mesh.elements))
        return state[name]

    def _slope(self, taken: Taken) -> FloatArray:
        """How the tension at the end of a step follows the potential, in MPa/mV, shape (nodes,)."""
        law, tension = self._tension, taken.before["tension"]
        potentials = taken.begin["potential"], taken.inputs["potential"]
        first, last = (law.target(potential) for potential in potentials)
        earlier, decay = (law.rate(potential) * taken.step for potential in potentials)
        earlier_slope, decay_slope = (law.rate_slope(potential) * taken.step for potential in potentials)
        target_slope = law.tension_per_potential_MPa_per_mV
        if law.time_integration == "forward_euler":
            return decay_slope * (last - tension) + decay * target_slope
        if np.array_equal(*potentials):
            return held_slope(tension, last, decay, target_slope, decay_slope)
        return ramped_slope(tension, (first, last), (earlier, decay), target_slope, (earlier_slope, decay_slope))

    def _reference(self, inputs: State) -> dict[str, FloatArray]:
        return {"reference_stretch": inputs["stretch"]} if self._tension.length_dependence else {}

    def _rate(self, potential: FloatArray) -> FloatArray:
        rate = self._tension.rate(potential)
        if rate.min() <= 0.0:
            node = int(rate.argmin())
            raise StepFailure(
                f"the delay function gives the rate {rate[node]:.3g}/ms at node {node} (potential "
                f"{potential[node]:.1f} mV): the active stress would grow without bound, away from its target"
                + (
                    ". That is the delay function as printed in the source document; use delay_function: gompertz"
                    if self._tension.delay_function == "as_printed"
                    else ""
                )
            )
        return rate

    def _length_factor(self, stretch: FloatArray) -> FloatArray | float:
        eta = self._tension.length_dependence
        if not eta:
            return 1.0
        factor = 1.0 + eta * (self._average @ stretch - 1.0)
        if factor.min() < 0.0:
            raise StepFailure(
                f"length_dependence {eta:g} makes the active stress negative at node {factor.argmin()}; lower it"
            )
        return np.asarray(factor)
