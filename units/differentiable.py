"""Units with derivatives of their outputs by their inputs, as FMI has them, for Newton-type masters and calibration.

FMI 2.0.4, section 2.1.9 (fmi2GetDirectionalDerivative); FMI 3.0, section 2.2.11 (directional and adjoint derivatives).
After a step it is the derivative of the outputs at its end by the values that the inputs were set to for it; where an
input ran to another end, both ends move along. In initialization mode and until the first step it is that of the
initial outputs by the initial inputs. What is set after the step does not count before the next one.

Derivatives are exact, not differences. Nothing is computed unless somebody asks; what can be used again (factors of a
stiffness) is kept until the state changes.
"""

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray
from .derivative import Derivative
from .errors import InvalidInput, listed
from .field import checked_field
from .phase import Phase
from .snapshot import State
from .statistics import Statistic
from .taken import Taken
from .unit import Unit
from .variable import Variable


class Differentiable(Unit):
    """A unit that has derivatives; a subclass adds `derivative`."""

    differentiable: ClassVar[bool] = True
    #: The derivative that was asked for last, and the state it is at.
    _kept: tuple[State, Derivative] | None = None

    @abstractmethod
    def derivative(self, taken: Taken, state: State) -> Derivative:
        """The derivative of the output fields in `state`, which follows from `taken`, once the unit is prepared."""

    def directional_derivative(self, seed: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        """Derivatives of all outputs along `seed`, changes of inputs: those that it does not name do not change.

        Statistics are among them: a mean, and a maximum by the place that holds it. Arrays have the declared shapes.

        Raises
        ------
        InvalidInput
            For names of no input, fixed inputs, and values that are no numbers of the input's shape.
        CallOrderError
            Before initialization mode.
        StepFailure
            Where an equilibrium has no derivative: its tangent is singular.
        """
        inputs = self._moving()
        changes = self._seed(seed, inputs, "input that may change")
        derivative = self._at_present()
        with self._naming_parameters():
            fields = derivative.along(changes)
            result: dict[str, FloatArray] = {}
            for variable in self.outputs():
                if isinstance(variable, Statistic):
                    source = variable.source.name
                    result[variable.name] = np.asarray(np.sum(variable.gradient(self.get(source)) * fields[source]))
                else:
                    result[variable.name] = fields[variable.name]
            return self._sound({name: np.array(value) for name, value in result.items()})

    def adjoint_derivative(self, seed: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        """Gradients by all inputs that may change of the sum of the outputs times their weights in `seed`.

        Outputs that it does not name have no weight. Raises what `directional_derivative` does, with outputs for
        inputs.
        """
        given = self._seed(seed, self.outputs(), "output")
        derivative = self._at_present()
        with self._naming_parameters():
            weights = {
                variable.name: given[variable.name]
                for variable in self.outputs()
                if not isinstance(variable, Statistic)
            }
            for variable in self.outputs():
                if isinstance(variable, Statistic) and given[variable.name]:
                    source = variable.source.name
                    weights[source] = weights[source] + given[variable.name] * variable.gradient(self.get(source))
            gradients = derivative.back(weights)
            return self._sound({variable.name: np.array(gradients[variable.name]) for variable in self._moving()})

    def do_step(self, time: float, step: float, ends: Mapping[str, ArrayLike] | None = None) -> None:
        """See Unit; factors of the state before it are let go."""
        super().do_step(time, step, ends)
        self._kept = None

    def _moving(self) -> list[Variable]:
        return [variable for variable in self.inputs() if not variable.fixed]

    def _seed(self, seed: Mapping[str, ArrayLike], variables: Iterable[Variable], what: str) -> dict[str, FloatArray]:
        """Values of all `variables`, those that the seed does not name being 0."""
        known = {variable.name: variable for variable in variables}
        for name in seed:
            if self.variable(name).name not in known:
                raise InvalidInput(
                    f"'{name}' of unit '{self.name}' is not an {what}; derivatives exist for: {listed(known)}"
                )
        return {
            name: checked_field(variable, seed[name], self.mesh, self.name)
            if name in seed
            else np.zeros(variable.shape(self.mesh))
            for name, variable in known.items()
        }

    def _at_present(self) -> Derivative:
        """The derivative at the present state, kept as long as it is that."""
        self._require(Phase.INITIALIZATION, Phase.STEPPING, Phase.TERMINATED)
        if self.phase is Phase.INITIALIZATION:
            state, taken = self._foresee(), Taken.initially(self._inputs)
        elif self._taken is None:
            raise InvalidInput(
                f"the state given to unit '{self.name}' does not say which step it came from; derivatives are "
                "available after the next step"
            )
        else:
            state, taken = self._state, self._taken
        if self._kept is None or self._kept[0] is not state:
            with self._naming_parameters():
                self._kept = state, self.derivative(taken, state)
        return self._kept[1]
