"""Any FMI 2.0 co-simulation FMU as a participant, through FMPy.

Fields live in buffers that are made once and handed to the raw FMI calls (see `fmu_variables`); FMPy's own lists cost
ten times as much.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2Integer

from ...fmus.model_description import INPUT_INTERPOLATION, TOOL
from ..errors import InputError, ParticipantError
from .fmu_log import FmuLog
from .fmu_variables import (
    check_parameters,
    check_start,
    declares_ramps,
    is_memoryless,
    ramps_itself,
    real_fields,
    scalar_type,
)
from .participant import Abilities, Parameters, Ramp, Values, Wait
from .ramping import PendingRamps

_FATAL = 4


class FmuParticipant:
    """An FMU, extracted and instantiated; `close` frees the instance and removes the extracted files."""

    def __init__(
        self, name: str, path: Path, parameters: Parameters, start: Parameters | None = None, ramps: bool = False
    ) -> None:
        self.name = name
        self._slave: FMU2Slave | None = None
        self._initialized = False
        self._folder: Path | None = None
        with self._naming(path):
            description = _read(path)
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
            self._takes_derivatives = bool(description.coSimulation.canInterpolateInputs)
            self._pending = PendingRamps()
            self._ramps: dict[str, Ramp] = {}
            self._log = FmuLog(formats=not _gives_texts(description.generationTool or ""))
            try:
                self._extract(path)
                self._instantiate(description)
                self._set_values(description.modelVariables, parameters, "parameter")
                self._set_values(description.modelVariables, start or {}, "start value")
            except BaseException:
                self.close()
                raise

    # --- Participant --------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """See Participant."""
        with self._blaming_input():
            self._call(lambda slave: slave.setupExperiment(startTime=0.0))
            self._call(lambda slave: slave.enterInitializationMode())

    def complete(self) -> None:
        """See Participant."""
        with self._blaming_input():
            self._call(lambda slave: slave.exitInitializationMode())
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
        self._call(lambda slave: slave.fmi2SetReal(slave.component, field.references, field.size, field.buffer))

    def get(self, name: str) -> Values:
        """See Participant."""
        field = self._fields[name]
        self._call(lambda slave: slave.fmi2GetReal(slave.component, field.references, field.size, field.buffer))
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
        self._call(lambda slave: slave.doStep(time, size))

    def _differentiate(self, name: str, ramp: Ramp, size: float) -> None:
        """Give an input as its value at the step's begin and its time derivatives there (FMI 2.0.4, section 4.2.1)."""
        self.set(name, ramp.begin)
        slope = (ramp.end - ramp.begin) / size
        derivatives = [slope]
        if ramp.curvature is not None:
            derivatives = [slope - 0.5 * size * ramp.curvature, ramp.curvature]
        field = self._fields[name]
        for order, derivative in enumerate(derivatives, start=1):
            orders = (fmi2Integer * field.size)(*[order] * field.size)
            field.values[...] = derivative
            self._call(partial(_set_derivatives, field.references, field.size, orders, field.buffer))

    def save(self) -> Any:
        """See Participant."""
        states: list[Any] = []
        self._call(lambda slave: states.append(slave.getFMUstate()))
        return states[0]

    def restore(self, state: Any) -> None:
        """See Participant."""
        self._call(lambda slave: slave.setFMUstate(state))

    def free(self, state: Any) -> None:
        """See Participant; without an instance there is nothing left to free."""
        if self._slave is not None:
            self._call(lambda slave: slave.freeFMUstate(state))

    def pack(self) -> bytes:
        """See Participant."""
        packed: list[bytes] = []
        state = self.save()
        try:
            self._call(lambda slave: packed.append(slave.serializeFMUstate(state)))
        finally:
            self.free(state)
        return packed[0]

    def unpack(self, data: bytes) -> None:
        """See Participant."""
        states: list[Any] = []
        self._call(lambda slave: states.append(slave.deSerializeFMUstate(data)))
        try:
            self.restore(states[0])
        finally:
            self.free(states[0])

    def close(self) -> None:
        """See Participant."""
        slave, self._slave = self._slave, None
        if slave is not None:
            # An FMU that failed may refuse to terminate; freeing it is all that is left to do.
            with suppress(FMICallException):
                if self._initialized:
                    slave.terminate()
            slave.freeInstance()
        if self._folder is not None:
            # An FMU written in Python puts its resources on the path of the process.
            sys.path[:] = [entry for entry in sys.path if not entry.startswith(str(self._folder))]
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    # --- inside -------------------------------------------------------------------------------------------------------

    def _call(self, call: Callable[[FMU2Slave], Any]) -> None:
        """Do one FMI call; a bad status, or a logged error (all that some FMUs can return), raises ParticipantError."""
        if self._slave is None:
            raise ParticipantError(f"the FMU of unit '{self.name}' is closed")
        self._log.clear()
        try:
            call(self._slave)
        except FMICallException as error:
            if error.status == _FATAL:
                # FMI allows no further call, not even to free it; those written in Python would crash the process.
                self._slave = None
            raise ParticipantError(str(self._log) or f"{error} The FMU logged no reason") from None
        if self._log.errors:
            raise ParticipantError(str(self._log))

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

    def _extract(self, path: Path) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="cosim-fmu-"))
        try:
            fmpy.extract(str(path), str(self._folder))
        # What zip readers raise on a damaged member, and FMPy's plain Exception for an illegal path.
        except Exception as error:
            raise InputError(f"the FMU cannot be extracted ({error})") from None

    def _instantiate(self, description: Any) -> None:
        try:
            slave = FMU2Slave(
                guid=description.guid,
                unzipDirectory=str(self._folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=self.name,
            )
            try:
                slave.instantiate(callbacks=self._log.callbacks, loggingOn=True)
            finally:
                # PythonFMU's wrapper keeps an object for hosts without Python and releases it twice when the process
                # ends, which now and then makes a finished run crash. Here it has no use and is given up at once.
                with suppress(AttributeError):
                    slave.dll.finalizePythonInterpreter()
        # FMPy raises plain Exceptions for a missing binary or a failed instantiation.
        except Exception as error:
            raise InputError(f"the FMU cannot be instantiated: {error} {self._log}".rstrip()) from None
        self._slave = slave

    def _set_values(self, variables: Any, values: Parameters, what: str) -> None:
        setters = {"Real": "setReal", "Integer": "setInteger", "Boolean": "setBoolean", "String": "setString"}
        declared = {variable.name: variable for variable in variables}
        for name, value in values.items():
            kind = scalar_type(declared[name])
            try:
                self._call(partial(_set_scalar, setters[kind], declared[name].valueReference, value))
            except ParticipantError as error:
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


def _gives_texts(tool: str) -> bool:
    """Whether the FMUs that `tool` made log plain texts: they never give arguments."""
    return "PythonFMU" in tool or tool.startswith(TOOL)


def _set_derivatives(references: Any, size: int, orders: Any, values: Any, slave: FMU2Slave) -> None:
    slave.fmi2SetRealInputDerivatives(slave.component, references, size, orders, values)


def _set_scalar(setter: str, reference: int, value: Any, slave: FMU2Slave) -> None:
    getattr(slave, setter)([reference], [value])


def _read(path: Path) -> Any:
    """FMPy's model description of the FMU at `path`."""
    if not path.is_file():
        raise InputError("no such FMU")
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    # FMPy raises plain Exceptions, and those of zip and XML readers.
    except Exception as error:
        raise InputError(f"FMPy cannot read it as an FMU ({error})") from None
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        raise InputError("not an FMI 2.0 co-simulation FMU")
    return description
