"""Any FMI 2.0 or 3.0 co-simulation FMU as a participant, through FMPy.

Fields live in buffers that are made once and handed to the raw FMI calls (see `fmu_variables`); FMPy's own lists cost
ten times as much. What the two versions of FMI call differently is in `fmi2_calls` and `fmi3_calls`.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException

from ...fmus.model_description import INPUT_INTERPOLATION
from ..errors import InputError, ParticipantError, ParticipantLost, ParticipantTerminated
from .fmi2_calls import Fmi2Calls
from .fmi3_calls import Fmi3Calls
from .fmu_description import read_description
from .fmu_log import FmuLog
from .fmu_variables import (
    Field,
    check_parameters,
    check_start,
    declares_ramps,
    is_memoryless,
    ramps_itself,
    real_fields,
)
from .participant import Abilities, Parameters, Ramp, Values, Wait
from .ramping import PendingRamps

_FATAL = 4

_Result = TypeVar("_Result")


class Calls(Protocol):
    """What a participant asks of its FMU, in one version of FMI.

    All calls raise FMPy's FMICallException for a status worse than a warning. Times are in s.
    """

    #: Whether the FMU follows inputs inside a step by their derivatives.
    takes_derivatives: bool

    @property
    def log(self) -> FmuLog:
        """What the FMU logs."""

    def instantiate(self, folder: Path, name: str) -> None:
        """Load the FMU extracted in `folder`; FMPy raises plain Exceptions where it cannot."""

    def free_instance(self) -> None:
        """Free the instance and unload the FMU."""

    def setup_experiment(self) -> None:
        """Set up an experiment from time 0 on: before any value is set, for some FMUs reset their parameters then."""

    def enter_initialization_mode(self) -> None:
        """Begin the initialization."""

    def exit_initialization_mode(self) -> None:
        """End it."""

    def terminate(self) -> None:
        """End the simulation."""

    def set(self, field: Field) -> None:
        """Set an input from the field's buffer."""

    def get(self, field: Field) -> None:
        """Read an output into the field's buffer."""

    def set_derivative(self, field: Field, order: int) -> None:
        """Set an input's time derivative of `order` from the field's buffer, if the FMU takes derivatives."""

    def set_start(self, variable: Any, value: Any) -> None:
        """Set a variable of any type, an array to one value everywhere; `variable` is FMPy's."""

    def step(self, time: float, size: float) -> None:
        """Advance from `time` by `size`; ParticipantTerminated if the FMU asks for the end of the simulation."""

    def save(self) -> Any:
        """The state."""

    def restore(self, state: Any) -> None:
        """Go back to a state."""

    def free(self, state: Any) -> None:
        """Give a state up."""

    def pack(self, state: Any) -> bytes:
        """A state as bytes."""

    def unpack(self, data: bytes) -> Any:
        """A state from bytes."""


#: By the version that a model description begins with.
_CALLS: dict[str, Callable[[Any], Calls]] = {"2.0": Fmi2Calls, "3.0": Fmi3Calls}


class FmuParticipant:
    """An FMU, extracted and instantiated; `close` frees the instance and removes the extracted files."""

    def __init__(
        self, name: str, path: Path, parameters: Parameters, start: Parameters | None = None, ramps: bool = False
    ) -> None:
        self.name = name
        self._calls: Calls | None = None
        self._initialized = False
        self._folder: Path | None = None
        with self._naming(path):
            description = read_description(path)
            if description.fmiVersion[:3] not in _CALLS or description.coSimulation is None:
                raise InputError("not an FMI 2.0 co-simulation FMU, nor one of FMI 3.0")
            if ramps and declares_ramps(description.modelVariables):
                parameters = {INPUT_INTERPOLATION: "linear"} | parameters
            check_parameters(parameters, description.modelVariables)
            check_start(start or {}, description.modelVariables)
            inputs, outputs = real_fields(path, description.modelVariables, parameters)
            self.inputs = {field.port.name: field.port for field in inputs}
            self.outputs = {field.port.name: field.port for field in outputs}
            self._fields = {field.port.name: field for field in (*inputs, *outputs)}
            ramps_by_itself = ramps_itself(description.modelVariables, parameters)
            self.abilities = _abilities(description.coSimulation, ramps_by_itself, is_memoryless(path))
            self._pending = PendingRamps()
            self._ramps: dict[str, Ramp] = {}
            calls = _CALLS[description.fmiVersion[:3]](description)
            self._log = calls.log
            self._takes_derivatives = calls.takes_derivatives
            try:
                self._folder = Path(tempfile.mkdtemp(prefix="cosim-fmu-"))
                _extract(path, self._folder)
                self._instantiate(calls)
                self._set_up()
                self._set_values(description.modelVariables, parameters, "parameter")
                self._set_values(description.modelVariables, start or {}, "start value")
            except BaseException:
                self.close()
                raise

    # --- Participant --------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """See Participant."""
        with self._blaming_input():
            self._call(lambda calls: calls.enter_initialization_mode())

    def complete(self) -> None:
        """See Participant."""
        with self._blaming_input():
            self._call(lambda calls: calls.exit_initialization_mode())
        self._initialized = True

    def set(self, name: str, values: Values) -> None:
        """See Participant."""
        field = self._fields[name]
        # NumPy would spread a single value over the whole field.
        if np.shape(values) != field.port.shape:
            raise ParticipantError(
                f"input '{name}' of unit '{self.name}' got shape {np.shape(values)}, expected {field.port.shape}"
            )
        field.values[...] = values
        self._call(lambda calls: calls.set(field))

    def get(self, name: str) -> Values:
        """See Participant."""
        field = self._fields[name]
        self._call(lambda calls: calls.get(field))
        return field.values.copy()

    def ramp(self, name: str, ramp: Ramp) -> None:
        """See Participant: by input derivatives where the FMU takes them, else by its own ramp."""
        if self._takes_derivatives:
            self._ramps[name] = ramp
        else:
            self._pending.add(name, ramp)

    def start(self, time: float, size: float) -> Wait:
        """See Participant; the step is done when this returns."""
        self._pending.apply(self.set, lambda: self._step(time, 0.0))
        ramps, self._ramps = self._ramps, {}
        for name, ramp in ramps.items():
            self._differentiate(name, ramp, size)
        self._step(time, size)
        return lambda: None

    def _step(self, time: float, size: float) -> None:
        self._call(lambda calls: calls.step(time, size))

    def _differentiate(self, name: str, ramp: Ramp, size: float) -> None:
        """Give an input as its value at the step's begin and its time derivatives there."""
        self.set(name, ramp.begin)
        slope = (ramp.end - ramp.begin) / size
        derivatives = [slope]
        if ramp.curvature is not None:
            derivatives = [slope - 0.5 * size * ramp.curvature, ramp.curvature]
        field = self._fields[name]
        for order, derivative in enumerate(derivatives, start=1):
            field.values[...] = derivative
            self._call(partial(_set_derivative, field, order))

    def save(self) -> Any:
        """See Participant."""
        return self._call(lambda calls: calls.save())

    def restore(self, state: Any) -> None:
        """See Participant."""
        self._call(lambda calls: calls.restore(state))

    def free(self, state: Any) -> None:
        """See Participant; without an instance there is nothing left to free."""
        if self._calls is not None:
            self._call(lambda calls: calls.free(state))

    def pack(self) -> bytes:
        """See Participant."""
        state = self.save()
        try:
            return self._call(lambda calls: calls.pack(state))
        finally:
            self.free(state)

    def unpack(self, data: bytes) -> None:
        """See Participant."""
        state = self._call(lambda calls: calls.unpack(data))
        try:
            self.restore(state)
        finally:
            self.free(state)

    def close(self) -> None:
        """See Participant."""
        calls, self._calls = self._calls, None
        if calls is not None:
            # An FMU that failed may refuse to terminate; freeing it is all that is left to do.
            with suppress(FMICallException):
                if self._initialized:
                    calls.terminate()
            calls.free_instance()
        if self._folder is not None:
            # An FMU written in Python puts its resources on the path of the process.
            sys.path[:] = [entry for entry in sys.path if not entry.startswith(str(self._folder))]
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    # --- inside -------------------------------------------------------------------------------------------------------

    def _call(self, call: Callable[[Calls], _Result]) -> _Result:
        """Do one FMI call; a bad status, or a logged error (all that some FMUs can return), raises ParticipantError."""
        if self._calls is None:
            raise ParticipantError(f"the FMU of unit '{self.name}' is closed")
        self._log.clear()
        try:
            result = call(self._calls)
        except FMICallException as error:
            if error.status == _FATAL:
                # FMI allows no further call, not even to free it; those written in Python would crash the process.
                self._calls = None
            kind = ParticipantLost if error.status == _FATAL else ParticipantError
            raise kind(str(self._log) or f"{error} The FMU logged no reason") from None
        except ParticipantTerminated as error:
            error.args = ("; ".join((*error.args, *self._log.errors)),)
            raise
        if self._log.errors:
            raise ParticipantError(str(self._log))
        return result

    @contextmanager
    def _naming(self, path: Path) -> Iterator[None]:
        """Put the unit and the file in front of what is wrong with them."""
        try:
            yield
        except InputError as error:
            raise InputError(f"unit '{self.name}': {path}: {error}") from None

    @contextmanager
    def _blaming_input(self) -> Iterator[None]:
        """Until the time loop runs, an error that the FMU blames on its input is the person's."""
        try:
            yield
        except ParticipantError as error:
            if self._log.blames_input:
                raise InputError(f"unit '{self.name}': {error}") from None
            raise

    def _instantiate(self, calls: Calls) -> None:
        if self._folder is None:
            raise TypeError("an FMU is extracted before it is instantiated")
        try:
            calls.instantiate(self._folder, self.name)
        # FMPy raises plain Exceptions for a missing binary or a failed instantiation.
        except Exception as error:
            raise InputError(f"the FMU cannot be instantiated: {error} {calls.log}".rstrip()) from None
        self._calls = calls

    def _set_up(self) -> None:
        try:
            self._call(lambda calls: calls.setup_experiment())
        except ParticipantError as error:
            raise InputError(f"the FMU takes no experiment that begins at 0 s: {error}") from None

    def _set_values(self, variables: Any, values: Parameters, what: str) -> None:
        declared = {variable.name: variable for variable in variables}
        for name, value in values.items():
            try:
                self._call(partial(_set_start, declared[name], value))
            except ParticipantError as error:
                kind = declared[name].type
                raise InputError(f"{what} '{name}' of type {kind} cannot be {value!r}: {error}") from None


def _abilities(declared: Any, ramps_itself: bool, memoryless: bool) -> Abilities:
    """From the CoSimulation element of a model description."""
    return Abilities(
        rolls_back=bool(declared.canGetAndSetFMUstate),
        serializes=bool(declared.canGetAndSetFMUstate and declared.canSerializeFMUstate),
        ramps=ramps_itself or bool(declared.canInterpolateInputs),
        any_step_size=bool(declared.canHandleVariableCommunicationStepSize),
        memoryless=memoryless,
    )


def _set_derivative(field: Field, order: int, calls: Calls) -> None:
    calls.set_derivative(field, order)


def _set_start(variable: Any, value: Any, calls: Calls) -> None:
    calls.set_start(variable, value)


def _extract(path: Path, folder: Path) -> None:
    try:
        fmpy.extract(str(path), str(folder))
    # What zip readers raise on a damaged member, and FMPy's plain Exception for an illegal path.
    except Exception as error:
        raise InputError(f"the FMU cannot be extracted ({error})") from None
