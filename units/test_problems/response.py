"""A number that responds to another one: at once, with a delay, or to its rate. Two of them form the simplest loops.

    y = w + ρ u′,   w = g u + b   or, with a delay,   w′ = ε (g u + b − w)

g is `gain`, b `offset`, ε `delay_rate_per_ms` and ρ `rate_gain_ms`; u′ is the change of the input over a step divided
by the length of the step. Two of these units in a loop show three properties of explicit coupling: the effect of a
gain, which does not depend on the step; the effect of a delay, which stabilises short steps; and the effect of a
dependence on the rate, which long steps stabilise. This is the loop of active stress and mechanics, reduced to numbers
(Regazzoni & Quarteroni 2021). The step is exact for an input that is held or varies linearly over it.

With a `disturbance`, the output deviates at the start, so that there is a deviation that grows or decays.

How it fails: the unit itself does not fail. If the coupling is unstable, the values grow until they are no longer
finite numbers.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import exprel

from ..arrays import FloatArray
from ..differentiable import Differentiable
from ..snapshot import State
from ..taken import Taken
from ..variable import Causality, Record, Variable, parameter
from .scalar_derivative import ScalarDerivative


@dataclass(frozen=True)
class Law:
    """How the output follows the input."""

    gain: float = parameter(1.0, "1", "g, output per input")
    offset: float = parameter(0.0, "1", "b, output without input")
    delay_rate_per_ms: float = parameter(
        0.0, "1/ms", "epsilon, rate at which the output follows; 0: without delay", at_least=0.0
    )
    rate_gain_ms: float = parameter(0.0, "ms", "rho, output per rate of the input, which is taken over a step")
    disturbance: float = parameter(0.0, "1", "error of the output at the start")

    def target(self, u: FloatArray) -> FloatArray:
        """g u + b."""
        return np.asarray(self.gain * u + self.offset)

    def followed(self, w: FloatArray, first: FloatArray, last: FloatArray, step_ms: float) -> FloatArray:
        """w after a step in which its target runs from `first` to `last`; arrays of any one shape."""
        if not self.delay_rate_per_ms:
            return last
        decay = self.delay_rate_per_ms * step_ms
        return np.asarray(w - (first - w) * np.expm1(-decay) + (last - first) * (1.0 - exprel(-decay)))


class Response(Differentiable):
    """A number that follows another: at once, with a delay, or its rate."""

    name = "response"
    interpolates = True
    groups = (Law,)
    fields = (
        Variable("u", Causality.INPUT, "1", "the number that the output responds to"),
        Variable("y", Causality.OUTPUT, "1", "the response", depends_on=("u",), record=Record.VALUE),
    )

    def prepare(self) -> None:
        """Take the parameters."""
        self._law = self.parameters(Law)

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The answer to an input that has been what it is for long, and the disturbance."""
        delayed = np.asarray(self._law.target(inputs["u"]) + self._law.disturbance)
        return {"delayed": delayed, "rate_per_ms": np.asarray(0.0), "last": inputs["u"].copy()}

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Exact for an input on a line; in a step of zero length nothing but an answer without delay moves."""
        law, last = self._law, inputs["u"]
        delayed = law.followed(state["delayed"], law.target(begin["u"]), law.target(last), step)
        if step == 0.0:
            return {**state, "delayed": delayed}
        # A held input has jumped to where it is since the last step; a ramped one comes from where its ramp begins.
        first = state["last"] if begin is inputs else begin["u"]
        return {"delayed": delayed, "rate_per_ms": np.asarray((last - first) / step), "last": last.copy()}

    def derivative(self, taken: Taken, state: State) -> ScalarDerivative:
        """See Differentiable. A held input moves away from what it was in the last step; a ramp keeps its rate."""
        law = self._law
        slope = law.gain
        if taken.before and law.delay_rate_per_ms:
            slope *= -float(np.expm1(-law.delay_rate_per_ms * taken.step))
        if taken.step > 0.0 and taken.held:
            slope += law.rate_gain_ms / taken.step
        return ScalarDerivative({"y": {"u": slope}})

    def output(self, name: str, state: State) -> FloatArray:
        """A scalar."""
        return np.asarray(state["delayed"] + self._law.rate_gain_ms * state["rate_per_ms"])
