"""The FMI-2 style step interface that every physics unit stands behind."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, IntArray, frozen
from .errors import CallOrderError, InvalidInput, StepFailure
from .field import check_finite, check_limit, checked_field
from .mesh import Mesh
from .phase import Phase
from .snapshot import Snapshot, State
from .statistics import Statistic, statistics
from .taken import Taken
from .variable import Causality, Scalar, Variable, parameters_of

Group = TypeVar("Group")
_MS_PER_S = 1000.0

#: What every unit says of itself beside its physics, once it is initialised (`Unit.implementation`, `Unit.fallbacks`).
IMPLEMENTATION = Variable(
    "implementation",
    Causality.CALCULATED_PARAMETER,
    "1",
    "the implementation that the unit uses on this machine: kernels, instruction set, linear solver; results differ "
    "between implementations in their last digits",
    start="",
    fixed=True,
)
FALLBACKS = Variable(
    "fallbacks",
    Causality.CALCULATED_PARAMETER,
    "1",
    "what is slower on this machine than necessary, and the remedy: one sentence per line",
    start="",
    fixed=True,
)

#: Orders of magnitude that a change of sign counts for, and parameters that a message names.
_FAR, _MOST_TOLD = 5.0, 3


@runtime_checkable
class Placed(Protocol):
    """A group of parameters that name places, which a mesh may have elsewhere."""

    def warnings(self, mesh: Mesh) -> Iterator[str]:
        """What is unusual of the places on `mesh`, in sentences for a person."""


class Unit(ABC):
    """Base of the physics units: variables, phases, checks and rollback; a subclass adds the physics.

    A subclass declares `name`, `groups` (frozen dataclasses of parameters), `fields` (inputs and outputs) and three
    methods that never change an array in place: `prepare`, `initial` and `advance`. What `advance` returns replaces
    the state only when it is complete and finite, so a step that fails leaves the unit as it was. The mean and maximum
    of every output field that moves are outputs as well (`statistics`), of which a subclass need not know.

    Times are seconds at this interface, as in FMI; inside, the physics is in ms.
    """

    name: ClassVar[str]
    groups: ClassVar[tuple[type, ...]]
    fields: ClassVar[tuple[Variable, ...]]
    #: Whether its outputs follow its inputs at the same time, whatever was before: a quasi-static equilibrium.
    memoryless: ClassVar[bool] = False
    #: Whether inputs may run over a step, from the values set to those given for its end.
    interpolates: ClassVar[bool] = False
    #: Whether there are derivatives of its outputs by its inputs (`differentiable`).
    differentiable: ClassVar[bool] = False

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.phase = Phase.INSTANTIATED
        self._parameters: dict[str, Scalar] = {}
        self._inputs: dict[str, FloatArray] = {}
        self._state: dict[str, FloatArray] = {}
        # Of a unit that has derivatives, what the state was computed from.
        self._taken: Taken | None = None
        # The parameters and fixed inputs that `prepare` was called with last; None before.
        self._prepared: tuple[dict[str, Scalar], dict[str, FloatArray]] | None = None
        # The state that the initialisation would end in as things are, if somebody wanted to know.
        self._foreseen: dict[str, FloatArray] | None = None

    # --- declaration -------------------------------------------------------------------------------------------------

    @classmethod
    def variables(cls) -> tuple[Variable, ...]:
        """All of its variables: parameters, inputs and outputs, the outputs' statistics, what it computes with."""
        return tuple(_declared(cls).values())

    @classmethod
    def inputs(cls) -> tuple[Variable, ...]:
        """The inputs."""
        return tuple(variable for variable in cls.fields if variable.causality is Causality.INPUT)

    @classmethod
    def outputs(cls) -> tuple[Variable, ...]:
        """The outputs, statistics of fields included."""
        return tuple(variable for variable in cls.variables() if variable.causality is Causality.OUTPUT)

    @classmethod
    def variable(cls, name: str) -> Variable:
        """The variable `name`; InvalidInput if the unit has none."""
        try:
            return _declared(cls)[name]
        except KeyError:
            raise InvalidInput(f"unit '{cls.name}' has no variable '{name}'") from None

    # --- the mesh ----------------------------------------------------------------------------------------------------

    @classmethod
    def check_mesh(cls, mesh: Mesh) -> None:
        """InvalidInput if `mesh` lacks an anatomy that the unit needs; most need none."""
        return

    def warnings(self) -> Iterator[str]:
        """What is unusual of the parameters on this mesh, in sentences for a person."""
        for group in self.groups:
            parameters: object = self.parameters(group)
            if isinstance(parameters, Placed):
                yield from parameters.warnings(self.mesh)

    # --- the machine --------------------------------------------------------------------------------------------------

    def implementation(self) -> str:
        """What it computes with on this machine, as far as bits depend on it: kernels, instruction set, linear solver.

        Asked for when the unit is prepared. Two that say the same give the same bits.
        """
        return "NumPy"

    def fallbacks(self) -> Iterator[str]:
        """What is slower on this machine than it need be, in sentences for a person, each with the remedy.

        Asked for when the unit is prepared. Units that lack the same say it in the same words.
        """
        yield from ()

    # --- life cycle, in FMI order -------------------------------------------------------------------------------------

    def instantiate(self, parameters: Mapping[str, Any]) -> None:
        """Take parameters over the declared defaults; InvalidInput for an unknown name or a value out of range."""
        self._require(Phase.INSTANTIATED)
        # Checked all before any is taken: a refused call changes nothing.
        checked = {name: self._parameter(name).checked(value) for name, value in parameters.items()}
        self._parameters = self._parameters | checked

    def setup_experiment(self, start_time: float = 0.0, stop_time: float | None = None) -> None:
        """Accept the experiment's times in s; the physics starts at 0, but for a unit without memory."""
        self._require(Phase.INSTANTIATED)
        if start_time != 0.0 and not self.memoryless:
            raise InvalidInput(f"unit '{self.name}' starts at t = 0 s, not at {start_time} s")

    def enter_initialization_mode(self) -> None:
        """From here inputs get their initial values."""
        self._require(Phase.INSTANTIATED)
        # New ones, since saved states hold the old.
        self._inputs = {item.name: self._default(item) for item in self.inputs()} | self._inputs
        self.phase = Phase.INITIALIZATION

    def exit_initialization_mode(self) -> None:
        """Build the operators from parameters and inputs and compute the initial state.

        Raises
        ------
        InvalidInput
            If parameters, inputs and mesh do not fit together.
        StepFailure
            If the physics has no initial state.
        """
        self._require(Phase.INITIALIZATION)
        self._foreseen = None
        with self._naming_parameters():
            self._prepare()
            self._state = self._sound(self.initial(self._inputs))
        self._taken = Taken.initially(self._inputs) if self.differentiable else None
        self.phase = Phase.STEPPING

    def do_step(self, time: float, step: float, ends: Mapping[str, ArrayLike] | None = None) -> None:
        """Advance from `time` by `step` (both in s, step ≥ 0) with the inputs last set.

        Inputs keep their values over the step, but for those in `ends`: where the unit interpolates its inputs, they
        run linearly from the values set to those `ends`. After the step they are what was set, whatever they ran to. A
        step of 0 lets a memoryless unit follow its inputs and leaves the others as they are.

        Raises
        ------
        InvalidInput
            For times that are no times, and for ends of inputs that cannot have them.
        StepFailure
            If the physics cannot be advanced; the state is then as before the call.
        """
        self._require(Phase.STEPPING)
        if not (np.isfinite(time) and np.isfinite(step) and step >= 0.0):
            raise InvalidInput(
                f"unit '{self.name}' cannot step from {time} s by {step} s: both have to be finite, the step >= 0"
            )
        inputs = self._inputs | self._ends(ends) if ends else self._inputs
        taken = Taken(self._state, self._inputs, inputs, time * _MS_PER_S, step * _MS_PER_S)
        with self._naming_parameters():
            self._state = self._sound(self.advance(taken.before, taken.begin, inputs, taken.time, taken.step))
        self._taken = taken if self.differentiable else None

    def terminate(self) -> None:
        """End the life of the instance; only `get` and `reset` remain."""
        self._require(Phase.STEPPING)
        self.phase = Phase.TERMINATED

    def reset(self) -> None:
        """Return to the moment after construction: default parameters, no inputs, no state."""
        self.phase = Phase.INSTANTIATED
        self._parameters = {}
        self._inputs = {}
        self._state = {}
        self._taken = None
        self._foreseen = None

    # --- values -------------------------------------------------------------------------------------------------------

    def set(self, name: str, value: ArrayLike | str) -> None:
        """Set a parameter (until the initialisation is over) or an input (shape as declared, finite)."""
        variable = self.settable(name)
        if variable.causality is Causality.PARAMETER:
            # A new one, since saved states hold the old.
            self._parameters = self._parameters | {name: variable.checked(value)}
        else:
            field = self._field(variable, value)
            if variable.fixed and self.phase is Phase.STEPPING:
                # Many masters set every connected input before every step.
                if not np.array_equal(field, self._inputs[name]):
                    raise CallOrderError(f"input '{name}' of unit '{self.name}' is fixed after initialisation")
                return
            self._inputs = self._inputs | {name: field}
        self._foreseen = None

    def settable(self, name: str) -> Variable:
        """The variable `name`, if it may be set now.

        Raises
        ------
        CallOrderError
            Later than this phase: parameters until the initialisation is over, inputs until the end.
        InvalidInput
            For what is neither.
        """
        variable = self.variable(name)
        if variable.causality is Causality.PARAMETER:
            self._require(Phase.INSTANTIATED, Phase.INITIALIZATION)
        elif variable.causality is Causality.INPUT:
            self._require(Phase.INSTANTIATED, Phase.INITIALIZATION, Phase.STEPPING)
        else:
            raise InvalidInput(f"'{name}' is {variable.causality} of unit '{self.name}' and cannot be set")
        return variable

    def check_values(self, variable: Variable, values: FloatArray, places: IntArray | None = None) -> None:
        """InvalidInput for values of an input that are not finite, or not above the limit that it has.

        They are those at `places` of its flattened array, or the whole, of its shape.
        """
        check_finite(variable, values, self.mesh, self.name, places)
        check_limit(variable, values, self.name)

    def get(self, name: str) -> Any:
        """A variable's value: read-only array of the declared shape, or the parameter's scalar.

        In initialization mode an output is what it would be if that ended now, which is where masters look for the
        initial values of inputs (FMI 2.0.4, section 4.2.4). What the unit computes with is an empty text until it is
        initialised.

        Raises
        ------
        InvalidInput, StepFailure
            In initialization mode, as `exit_initialization_mode` would; StepFailure for an output that is not finite.
        """
        variable = self.variable(name)
        if variable.causality is Causality.PARAMETER:
            return self._parameters.get(name, variable.start)
        if variable.causality is Causality.INPUT:
            return self._inputs[name] if name in self._inputs else self._default(variable)
        if variable.causality is Causality.CALCULATED_PARAMETER:
            return self._told(variable)
        self._require(Phase.INITIALIZATION, Phase.STEPPING, Phase.TERMINATED)
        state = self._foresee() if self.phase is Phase.INITIALIZATION else self._state
        source = variable.source.name if isinstance(variable, Statistic) else name
        with self._naming_parameters():
            value = self._sound({source: self.output(source, state)})[source]
        return variable(value) if isinstance(variable, Statistic) else value

    def parameters(self, group: type[Group]) -> Group:
        """The unit's values of one parameter group, as that frozen dataclass."""
        return group(**{variable.name: self.get(variable.name) for variable in parameters_of(group)})

    def directional_derivative(self, seed: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        """See `differentiable.Differentiable`; InvalidInput, since this unit has no derivatives."""
        raise InvalidInput(f"unit '{self.name}' gives no derivatives of its outputs")

    def adjoint_derivative(self, seed: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        """See `differentiable.Differentiable`; InvalidInput, since this unit has no derivatives."""
        raise InvalidInput(f"unit '{self.name}' gives no derivatives of its outputs")

    # --- rollback -----------------------------------------------------------------------------------------------------

    def get_state(self) -> Snapshot:
        """All that `set_state` needs to return here exactly. Costs references only: no array is copied."""
        return Snapshot(
            self.name, self.mesh.fingerprint, self.phase, self._parameters, self._inputs, dict(self._state), self._taken
        )

    def set_state(self, snapshot: Snapshot) -> None:
        """Go back (or forth) to `snapshot`, in any phase: the next step gives the same bits as it gave from there.

        Parameters and fixed inputs (fibres) are part of it; where they differ from the present ones the unit is
        prepared anew, which takes as long as its initialisation.

        Raises
        ------
        InvalidInput
            If the snapshot is of another unit or of another mesh; everything is then as before the call.
        """
        known = self._state if snapshot.parameters == self._parameters else {}
        snapshot.check_fits(self.name, self.mesh, self.inputs(), known)
        parameters = {name: self._parameter(name).checked(value) for name, value in snapshot.parameters.items()}
        before = self._parameters, self._inputs
        self._parameters, self._inputs = parameters, dict(snapshot.inputs)
        if snapshot.phase.initialized and not self._is_prepared():
            try:
                with self._naming_parameters():
                    self._prepare()
            except BaseException:
                self._parameters, self._inputs = before
                self._foreseen = None
                if self.phase.initialized:
                    self._prepare()
                raise
        self.phase, self._state, self._taken = snapshot.phase, dict(snapshot.state), snapshot.taken
        self._foreseen = None

    serialize = staticmethod(Snapshot.to_bytes)
    deserialize = staticmethod(Snapshot.from_bytes)

    # --- the physics, in the subclass ---------------------------------------------------------------------------------

    @abstractmethod
    def prepare(self) -> None:
        """Build what stays the same over the run from parameters, mesh and fixed inputs."""

    @abstractmethod
    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The state at t = 0."""

    @abstractmethod
    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """The state one `step` (ms) after `time` (ms).

        Inputs run linearly from `begin` to `inputs`; where they are held, the two are one object.
        """

    @abstractmethod
    def output(self, name: str, state: State) -> FloatArray:
        """The output `name` of `fields` in `state`, read-only, of the declared shape."""

    def _told(self, variable: Variable) -> str:
        if self.phase in (Phase.INSTANTIATED, Phase.INITIALIZATION):
            return ""
        return self.implementation() if variable is IMPLEMENTATION else "\n".join(self.fallbacks())

    def _prepare(self) -> None:
        """`prepare`, with what it is called with kept."""
        self._prepared = None
        self.prepare()
        self._prepared = self._parameters, self._fixed_inputs()

    def _is_prepared(self) -> bool:
        """Whether `prepare` was called with the present parameters and fixed inputs."""
        if self._prepared is None:
            return False
        parameters, fixed = self._prepared
        defaults = {name: self.variable(name).start for name in (*parameters, *self._parameters)}
        own = self._fixed_inputs()
        return defaults | parameters == defaults | self._parameters and all(
            fixed[name] is own[name] or np.array_equal(fixed[name], own[name]) for name in own
        )

    def _fixed_inputs(self) -> dict[str, FloatArray]:
        return {item.name: self._inputs[item.name] for item in self.inputs() if item.fixed}

    def _ends(self, ends: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        """`ends` as arrays; InvalidInput for one that the unit cannot have."""
        checked = {}
        for name, value in ends.items():
            variable = self.variable(name)
            if not self.interpolates or variable.causality is not Causality.INPUT or variable.fixed:
                raise InvalidInput(
                    f"'{name}' of unit '{self.name}' keeps its value over a step; it takes no value at the end"
                )
            checked[name] = self._field(variable, value)
        return checked

    def _foresee(self) -> State:
        """The state in which the initialisation would end; kept until something is set."""
        if self._foreseen is None:
            with self._naming_parameters():
                self._prepare()
                self._foreseen = self._sound(self.initial(self._inputs))
        return self._foreseen

    @contextmanager
    def _naming_parameters(self) -> Iterator[None]:
        """Put the parameters that are far from their defaults behind what goes wrong in the physics.

        Numbers that nothing can be computed with end in StepFailure; what overflows on the way there is not warned of,
        for the state and the outputs are checked.
        """
        try:
            with np.errstate(all="ignore"):
                yield
        except (InvalidInput, StepFailure) as error:
            unusual = self._unusual_parameters()
            if not unusual:
                raise
            raise type(error)(f"{error}{unusual}") from error
        except (np.linalg.LinAlgError, ArithmeticError, MemoryError) as error:
            unusual = self._unusual_parameters()
            # Without a parameter to blame, a division by zero is a bug, and should look like one.
            if not unusual and isinstance(error, ArithmeticError):
                raise
            reason = str(error) or type(error).__name__
            raise StepFailure(f"the computation cannot continue ({reason}){unusual}") from error

    def _unusual_parameters(self) -> str:
        """The given parameters farthest from their defaults, to be put behind a message."""
        distances: dict[str, float] = {}
        for name, value in self._parameters.items():
            usual = self.variable(name).start
            if isinstance(value, str) or isinstance(usual, str) or value == usual:
                continue
            # A zero, or another sign, is far; the scale of what is usually zero is taken to be 1.
            ratio = value / (usual or 1.0)
            distances[name] = abs(np.log10(ratio)) if ratio > 0.0 else _FAR
        far = sorted((name for name in distances if distances[name] >= 1.0), key=lambda name: -distances[name])
        if not far:
            return ""
        told = ", ".join(f"{name} = {self._parameters[name]:g}" for name in far[:_MOST_TOLD])
        return f". Far from their defaults are: {told}"

    # --- checks -------------------------------------------------------------------------------------------------------

    def _require(self, *phases: Phase) -> None:
        if self.phase not in phases:
            allowed = " or ".join(phase.value for phase in phases)
            raise CallOrderError(
                f"unit '{self.name}' is {self.phase.value}; this call needs it to be {allowed}. "
                "The order is: instantiate, setup_experiment, enter and exit initialization mode, do_step, terminate"
            )

    def _default(self, variable: Variable) -> FloatArray:
        return frozen(np.full(variable.shape(self.mesh), variable.start))

    def _field(self, variable: Variable, value: ArrayLike | str) -> FloatArray:
        array = checked_field(variable, value, self.mesh, self.name)
        check_limit(variable, array, self.name)
        return array

    def _parameter(self, name: str) -> Variable:
        variable = self.variable(name)
        if variable.causality is not Causality.PARAMETER:
            raise InvalidInput(f"'{name}' is {variable.causality} of unit '{self.name}', not a parameter")
        return variable

    def _sound(self, state: dict[str, FloatArray]) -> dict[str, FloatArray]:
        for name, value in state.items():
            if not np.isfinite(value).all():
                where = np.argwhere(~np.isfinite(np.atleast_1d(value)))[0]
                raise StepFailure(f"'{name}' is not finite any more, first at index {where.tolist()}")
            value.setflags(write=False)
        return state


@cache
def _declared(unit: type[Unit]) -> dict[str, Variable]:
    """All variables by name, in their order; kept, because every `get` and `set` looks one up."""
    parameters = (variable for group in unit.groups for variable in parameters_of(group))
    declared: dict[str, Variable] = {}
    own = (IMPLEMENTATION, FALLBACKS)
    for variable in (*parameters, *unit.fields, *statistics(unit.fields), *own):
        if variable.name in declared:
            raise TypeError(f"the variable '{variable.name}' is declared twice")
        declared[variable.name] = variable
    return declared
