"""Any FMI 2.0 or 3.0 co-simulation FMU as a participant, through FMPy.

Fields live in buffers that are made once and handed to the raw FMI calls (see `fmu_variables`); FMPy's own lists cost
ten times as much. What the two versions of FMI call differently is in `fmi2_calls` and `fmi3_calls`.
"""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from fmpy.fmi1 import FMICallException

from ...fmus.annotations import FALLBACKS, IMPLEMENTATION
from ..activity import doing
from ..errors import InputError, ParticipantError, ParticipantLost, ParticipantTerminated
from ..quoting import quoted
from .fmi2_calls import Fmi2Calls
from .fmi3_calls import Fmi3Calls
from .fmu_digest import Digest, read_digest
from .fmu_file import FmuFile, check_binary
from .fmu_log import FmuLog
from .fmu_variables import (
    READABLE,
    Field,
    check_parameters,
    check_start,
    fields,
    groups,
    ports,
)
from .participant import Abilities, Implementation, Parameters, Ports, Ramp, Values, Wait
from .ramping import Ramps, whole
from .unpacked import Unpacked

_ERROR, _FATAL = 3, 4

_MS_PER_S = 1000.0

#: The highest time derivative of an input that there is a value for.
_HIGHEST_ORDER = 2

_Result = TypeVar("_Result")


class Calls(Protocol):
    """What a participant asks of its FMU, in one version of FMI.

    All calls raise FMPy's FMICallException for a status worse than a warning. Times are in s.
    """

    #: Whether inputs run over a step by their derivatives at its begin (FMI 2.0); else by what they are inside of it,
    #: for which the FMU asks (FMI 3.0).
    by_derivatives: bool

    @property
    def log(self) -> FmuLog:
        """What the FMU logs."""

    def instantiate(self, folder: Path, name: str) -> None:
        """Load the FMU extracted in `folder`; FMPy raises plain Exceptions where it cannot."""

    def free_instance(self) -> None:
        """Free the instance and unload the FMU."""

    def setup_experiment(self, start: float) -> None:
        """Set up an experiment from `start` on: before any value is set, for some FMUs reset their parameters then."""

    def enter_initialization_mode(self, start: float) -> None:
        """Begin the initialization of an experiment from `start` on."""

    def exit_initialization_mode(self) -> None:
        """End it."""

    def terminate(self) -> None:
        """End the simulation."""

    def set(self, field: Field) -> None:
        """Set an input from the field's buffer."""

    def get(self, field: Field) -> None:
        """Read an output into the field's buffer."""

    def set_derivative(self, field: Field, order: int) -> None:
        """Set an input's time derivative of `order` from the field's buffer."""

    def run(self, ramps: Sequence[tuple[Field, Ramp]]) -> None:
        """Let inputs vary over the next step, for an FMU that asks for intermediate values."""

    def set_start(self, variable: Any, value: Any) -> None:
        """Set a variable of any type, an array to one value everywhere or to a list; `variable` is FMPy's."""

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

#: The FMUs loaded in this process that can be there once only, by identifier and GUID, and whose they are.
_ONLY_ONES: dict[tuple[str, str], str] = {}


class FmuParticipant:
    """An FMU, extracted and instantiated; `close` frees the instance and removes the extracted files.

    Parameters
    ----------
    path:
        The FMU, or the folder that it was unpacked to.
    parameters, start:
        Values of its parameters, and start values of other variables.
    observe:
        Variables to be recorded, as names or with `*` and `?`.
    start_s:
        The time at which it begins.
    loaded:
        False reads the description only: ports and abilities are known, and nothing of the FMU's code is run.
    """

    def __init__(
        self,
        name: str,
        path: Path,
        parameters: Parameters,
        start: Parameters | None = None,
        observe: Sequence[str] = (),
        loaded: bool = True,
        start_s: float = 0.0,
    ) -> None:
        self.name = name
        self._start_s = start_s
        self._calls: Calls | None = None
        self._initialized = False
        #: Whether the FMU returned an error that nothing has brought it back from.
        self._failed = False
        self._unpacked: Unpacked | None = None
        self._only: tuple[str, str] | None = None
        with self._naming(path):
            file = FmuFile(path)
            digest = read_digest(file, {*parameters, *(start or {})}, whole=bool(observe))
            check_binary(digest.names, digest)
            variables = digest.modelVariables
            check_parameters(parameters, variables)
            check_start(start or {}, variables)
            self._inputs = fields(digest, digest.inputs, parameters)
            self._outputs = fields(digest, digest.outputs, parameters)
            self.inputs, self.outputs = ports(self._inputs), ports(self._outputs)
            self._told = _told(digest)
            self._observed = fields(digest, groups(variables, READABLE), parameters) if observe else {}
            self._observable = ports(self._observed)
            self.observed = self._observable.chosen(observe, f"unit '{name}'")
            self.abilities = _abilities(digest.coSimulation, digest.memoryless)
            self._elements: dict[tuple[bool, str], Field] = {}
            self._ramps = Ramps()
            # FMI 2.0 has no attribute for the highest order that an FMU takes; this project's take the first.
            self._order = 1 if digest.fields else _HIGHEST_ORDER
            calls = _CALLS[digest.fmiVersion](digest)
            self._log = calls.log
            self._log.instance = name
            self._by_derivatives = calls.by_derivatives
            # Inputs get their start values in the initialization mode (FMI 2.0.4, section 4.2.4).
            starts = start or {}
            inputs = {item.name: item for item in variables if item.causality == "input" and item.name in starts}
            self._started, self._starts = list(inputs.values()), {name: starts[name] for name in inputs}
            # Made once a step, for it is shown at every call.
            self._activity = self._at_work()
            if not loaded:
                return
            try:
                self._claim(digest)
                self._unpacked = Unpacked(file, digest)
                self._instantiate(calls)
                self._set_up()
                self._set_values(variables, parameters, "parameter")
                self._set_values(
                    variables, {name: starts[name] for name in starts.keys() - inputs.keys()}, "start value"
                )
            except BaseException:
                self.close()
                raise

    # --- Participant --------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """See Participant."""
        with self._blaming_input():
            self._call(lambda calls: calls.enter_initialization_mode(self._start_s))
        self._set_values(self._started, self._starts, "start value")

    def complete(self) -> None:
        """See Participant."""
        with self._blaming_input():
            self._call(lambda calls: calls.exit_initialization_mode())
        self._initialized = True

    def set(self, name: str, values: Values) -> None:
        """See Participant."""
        self._ramps.forget(name)
        field = self._field(name, self._inputs, self.inputs)
        # NumPy would spread a single value over the whole field.
        if np.shape(values) != self.inputs[name].shape:
            raise ParticipantError(
                f"input '{name}' of unit '{self.name}' got shape {np.shape(values)}, expected {self.inputs[name].shape}"
            )
        if field.port.shape != np.shape(values):
            # An element of a variable that is an array: the others stay as they are.
            _, values = self.inputs.with_element(name, values, lambda _: self._read(field))
        field.fill(values)
        self._call(lambda calls: calls.set(field))

    def get(self, name: str) -> Values:
        """See Participant."""
        is_output = self.outputs.known(name)
        own, known = (self._outputs, self.outputs) if is_output else (self._observed, self._observable)
        field = self._field(name, own, known)
        values = self._ramps.shown(field.port.name, self.inputs, self._read(field))
        return values if field.port.name == name else known.element(name, lambda _: values)

    def _field(self, name: str, own: Mapping[str, Field], known: Ports) -> Field:
        """The field of a port, or of an element of one; that of the whole where the FMU gives no elements."""
        if name in own:
            return own[name]
        place = known.place(name)
        if place is None:
            raise ParticipantError(f"unit '{self.name}' has no variable '{name}'")
        whole = own[place[0].name]
        if whole.is_array_variable:
            return whole
        key = (own is self._inputs, name)
        if key not in self._elements:
            self._elements[key] = whole.element(name, place[1])
        return self._elements[key]

    def _read(self, field: Field) -> Values:
        self._call(lambda calls: calls.get(field))
        return field.values()

    def ramp(self, name: str, ramp: Ramp) -> None:
        """See Participant."""
        self._ramps.add(name, ramp)

    def start(self, time: float, size: float) -> Wait:
        """See Participant; the step is done when this returns."""
        ramps = self._ramps.take()
        if self._by_derivatives:
            for name, ramp in ramps.items():
                self._differentiate(name, ramp, size)
        elif ramps:
            self._run(ramps)
        self._step(time, size)
        self._ramps.ended(ramps)
        return lambda: None

    def _run(self, ramps: Mapping[str, Ramp]) -> None:
        """Give inputs as their values at the step's begin, and let the FMU ask for those inside of it."""
        running = []
        for name, ramp in whole(ramps, self.inputs, lambda name: self._read(self._inputs[name])).items():
            field = self._inputs[name]
            if field.interpolated:
                running.append((field, ramp))
            self.set(name, ramp.begin if field.interpolated else ramp.end)
        self._call(lambda calls: calls.run(running))

    def _step(self, time: float, size: float) -> None:
        self._log.time = time
        self._activity = self._at_work()
        self._call(lambda calls: calls.step(time, size))

    def _differentiate(self, name: str, ramp: Ramp, size: float) -> None:
        """Give an input as its value at the step's begin and its time derivatives there."""
        self.set(name, ramp.begin)
        slope = ramp.slope(size)
        derivatives = [slope]
        if ramp.curvature is not None and self._order > 1:
            derivatives = [slope - 0.5 * size * ramp.curvature, ramp.curvature]
        field = self._field(name, self._inputs, self.inputs)
        for order, derivative in enumerate(derivatives, start=1):
            field.fill(derivative)
            try:
                self._call(partial(_set_derivative, field, order))
            except ParticipantLost:
                raise
            except ParticipantError as error:
                if order == 1:
                    raise ParticipantError(
                        f"it refuses derivatives of its inputs, although canInterpolateInputs is true ({error}); "
                        "use `coupling.interpolation: hold`"
                    ) from None
                self._order = order - 1
                print(
                    f"note: unit '{self.name}' accepts derivatives of its inputs up to order "
                    f"{self._order}; those of higher order from `coupling.extrapolation` are left out ({error})",
                    file=sys.stderr,
                )
                self._differentiate(name, ramp, size)
                return

    def save(self) -> Any:
        """See Participant."""
        return self._call(lambda calls: calls.save())

    def restore(self, state: Any) -> None:
        """See Participant."""
        self._ramps.forget()
        self._call(lambda calls: calls.restore(state))
        # The way back from an error (FMI 2.0.4, section 2.1.3; FMI 3.0, section 2.2.3).
        self._failed = False

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

    def implementation(self) -> Implementation:
        """See Participant; this project's FMUs tell it in two variables."""
        told = {name: str(self._read(field)) for name, field in self._told.items()}
        return Implementation(told.get(IMPLEMENTATION, ""), tuple(told.get(FALLBACKS, "").splitlines()))

    def log_to(self, path: Path) -> None:
        """See Participant."""
        self._log.write_to(path)

    def close(self) -> None:
        """See Participant."""
        calls, self._calls = self._calls, None
        unscathed = calls is not None and self._initialized and not self._failed
        if calls is not None:
            # An FMU that returned an error is not to be terminated; freeing it is all that is left to do.
            try:
                if unscathed:
                    self._do(calls, lambda calls: calls.terminate())
            except ParticipantLost:
                calls, unscathed = None, False
            except ParticipantError:
                unscathed = False
        if calls is not None:
            self._do(calls, lambda calls: calls.free_instance())
        if self._only is not None:
            _ONLY_ONES.pop(self._only, None)
            self._only = None
        self._log.close()
        unpacked, self._unpacked = self._unpacked, None
        if unpacked is not None:
            # An FMU written in Python puts its resources on the path of the process.
            sys.path[:] = [entry for entry in sys.path if not entry.startswith(str(unpacked.folder))]
            unpacked.give_up(unscathed)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _call(self, call: Callable[[Calls], _Result]) -> _Result:
        """Do one FMI call; a bad status, or a logged error (all that some FMUs can return), raises ParticipantError."""
        if self._calls is None:
            raise ParticipantError(f"the FMU of unit '{self.name}' is closed")
        result = self._do(self._calls, call)
        if self._log.errors:
            raise ParticipantError(str(self._log))
        return result

    def _at_work(self) -> str:
        return f"unit '{self.name}' at {self._log.time * _MS_PER_S:.12g} ms"

    def _do(self, calls: Calls, call: Callable[[Calls], _Result]) -> _Result:
        """All calls of the FMU go through here."""
        self._log.clear()
        try:
            with doing(self._activity):
                return call(calls)
        except FMICallException as error:
            self._failed = self._failed or error.status >= _ERROR
            if error.status == _FATAL:
                # FMI allows no further call, not even to free it; those written in Python would crash the process.
                self._calls = None
            kind = ParticipantLost if error.status == _FATAL else ParticipantError
            raise kind(str(self._log) or f"{error} The FMU logged no reason") from None
        except ParticipantTerminated as error:
            error.args = ("; ".join((*error.args, *self._log.errors)),)
            raise

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
        if self._unpacked is None:
            raise TypeError("an FMU is extracted before it is instantiated")
        folder, here = self._unpacked.folder, Path.cwd()
        try:
            self._do(calls, lambda calls: calls.instantiate(folder, self.name))
        # FMPy raises plain Exceptions for a missing binary or a failed instantiation.
        except Exception as error:
            # FMPy leaves the process in the folder of a library that cannot be loaded.
            os.chdir(here)
            raise InputError(_why_not(str(error), str(calls.log))) from None
        self._calls = calls

    def _claim(self, description: Digest) -> None:
        """InputError if the FMU can be in a process once only, and is there already."""
        if not description.coSimulation.canBeInstantiatedOnlyOncePerProcess:
            return
        key = (description.coSimulation.modelIdentifier, description.guid)
        if key in _ONLY_ONES:
            raise InputError(
                f"this FMU can be instantiated only once per process (canBeInstantiatedOnlyOncePerProcess), and unit "
                f"'{_ONLY_ONES[key]}' already uses it; run every unit in its own process (run.workers: processes)"
            )
        _ONLY_ONES[key] = self.name
        self._only = key

    def _set_up(self) -> None:
        try:
            self._call(lambda calls: calls.setup_experiment(self._start_s))
        except ParticipantError as error:
            raise InputError(f"the FMU refuses an experiment that starts at {self._start_s:g} s: {error}") from None

    def _set_values(self, variables: Any, values: Parameters, what: str) -> None:
        declared = {variable.name: variable for variable in variables}
        for name, value in values.items():
            try:
                self._call(partial(_set_start, declared[name], value))
            except ParticipantError as error:
                kind = declared[name].type
                raise InputError(f"{what} '{name}' of type {kind} cannot be {quoted(value)}: {error}") from None


def _abilities(declared: Any, memoryless: bool) -> Abilities:
    """From the CoSimulation element of a model description."""
    return Abilities(
        rolls_back=bool(declared.canGetAndSetFMUstate),
        serializes=bool(declared.canGetAndSetFMUstate and declared.canSerializeFMUstate),
        ramps=bool(declared.canInterpolateInputs),
        any_step_size=bool(declared.canHandleVariableCommunicationStepSize),
        memoryless=memoryless,
    )


def _told(digest: Digest) -> dict[str, Field]:
    """The texts in which this project's FMUs say what they compute with; a foreign one may mean anything by them."""
    variables = [item for item in digest.modelVariables if item.name in (IMPLEMENTATION, FALLBACKS)]
    return fields(digest, groups(variables, ("calculatedParameter",)), {}) if digest.fields else {}


def _set_derivative(field: Field, order: int, calls: Calls) -> None:
    calls.set_derivative(field, order)


def _set_start(variable: Any, value: Any, calls: Calls) -> None:
    calls.set_start(variable, value)


def _why_not(error: str, logged: str) -> str:
    """Why an FMU cannot be instantiated, by what FMPy says of it and what the FMU logged."""
    if "cannot open shared object file" in error:
        missing = error.rpartition(". ")[2] if ". " in error else error
        return f"its library cannot be loaded, because it needs another one: {missing}; install that"
    if any(sign in error for sign in ("ELF", "file too short", "mach-o", "incompatible architecture")):
        return f"its library is damaged, or made for another machine: {error}; export the FMU for this platform"
    if "undefined symbol" in error or "symbol not found" in error:
        return f"its library is incomplete: {error}; it has to contain every function of FMI"
    return f"the FMU cannot be instantiated: {error} {logged}".rstrip()
