"""The calls of an FMI 2.0 co-simulation FMU, through FMPy."""

from collections.abc import Sequence
from contextlib import suppress
from ctypes import byref
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2Boolean,
    fmi2Discard,
    fmi2Integer,
    fmi2LastSuccessfulTime,
    fmi2Real,
    fmi2Terminated,
    fmi2True,
)

from ...fmus.annotations import TOOL
from ..errors import ParticipantTerminated
from .fmu_log import Fmi2Log
from .fmu_variables import Field
from .participant import Ramp


class Fmi2Calls:
    """See Calls."""

    by_derivatives = True

    def __init__(self, description: Any) -> None:
        # Not the description itself: that of a heart holds some ten thousand variables.
        self._guid, self._model = description.guid, description.coSimulation.modelIdentifier
        self._slave: Any = None
        self._is_python = _is_python(description.generationTool or "")
        # FMUs in Python log plain texts: they never give arguments.
        self.log = Fmi2Log(formats=not self._is_python)

    def instantiate(self, folder: Path, name: str) -> None:
        """See Calls."""
        slave = FMU2Slave(
            guid=self._guid,
            unzipDirectory=str(folder),
            modelIdentifier=self._model,
            instanceName=name,
        )
        try:
            slave.instantiate(callbacks=self.log.callbacks, loggingOn=True)
        finally:
            # PythonFMU's wrapper keeps an object for hosts without Python and releases it twice when the process
            # ends, which now and then makes a finished run crash. Here it has no use and is given up at once.
            with suppress(AttributeError):
                slave.dll.finalizePythonInterpreter()
        self._slave = slave

    def free_instance(self) -> None:
        """See Calls."""
        self._slave.freeInstance()

    def setup_experiment(self, start: float) -> None:
        """See Calls."""
        self._slave.setupExperiment(startTime=start)

    def enter_initialization_mode(self, start: float) -> None:
        """See Calls."""
        self._slave.enterInitializationMode()

    def exit_initialization_mode(self) -> None:
        """See Calls."""
        self._slave.exitInitializationMode()

    def terminate(self) -> None:
        """See Calls."""
        self._slave.terminate()

    def set(self, field: Field) -> None:
        """See Calls."""
        call = getattr(self._slave, f"fmi2Set{field.kind}")
        call(self._slave.component, field.references, field.size, field.buffer)

    def get(self, field: Field) -> None:
        """See Calls."""
        call = getattr(self._slave, f"fmi2Get{field.kind}")
        call(self._slave.component, field.references, field.size, field.buffer)

    def set_derivative(self, field: Field, order: int) -> None:
        """See Calls (FMI 2.0.4, section 4.2.1)."""
        orders = (fmi2Integer * field.size)(*[order] * field.size)
        self._slave.fmi2SetRealInputDerivatives(
            self._slave.component, field.references, field.size, orders, field.buffer
        )

    def run(self, ramps: Sequence[tuple[Field, Ramp]]) -> None:
        """See Calls; an FMU of FMI 2.0 does not ask."""

    def set_start(self, variable: Any, value: Any) -> None:
        """See Calls."""
        # An enumeration is set as an Integer (FMI 2.0.4, section 2.2.7).
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        getattr(self._slave, f"set{kind}")([variable.valueReference], [value])

    def step(self, time: float, size: float) -> None:
        """See Calls."""
        # True: the master goes back to the step's begin at most, which is not prior to it (section 4.2.2). An FMU may
        # commit what it computed up to there, and some commit only then.
        try:
            self._slave.doStep(time, size, fmi2True)
        except FMICallException as error:
            if error.status == fmi2Discard and self._has_ended():
                raise self._end() from None
            raise

    def _has_ended(self) -> bool:
        """Whether the FMU discarded a step because it asks for the end (section 4.2.3)."""
        if self._is_python and self.log.errors:
            # PythonFMU's wrapper says of every discarded step that it is the end, of one that failed too.
            return False
        ended = fmi2Boolean()
        with suppress(FMICallException), self.log.aside():
            self._slave.fmi2GetBooleanStatus(self._slave.component, fmi2Terminated, byref(ended))
        return bool(ended.value)

    def _end(self) -> ParticipantTerminated:
        end, time = ParticipantTerminated("it requested the end of the simulation (fmi2Terminated)"), fmi2Real()
        with suppress(FMICallException), self.log.aside():
            self._slave.fmi2GetRealStatus(self._slave.component, fmi2LastSuccessfulTime, byref(time))
            end.time_s = time.value
        return end

    def save(self) -> Any:
        """See Calls."""
        return self._slave.getFMUstate()

    def restore(self, state: Any) -> None:
        """See Calls."""
        self._slave.setFMUstate(state)

    def free(self, state: Any) -> None:
        """See Calls."""
        self._slave.freeFMUstate(state)

    def pack(self, state: Any) -> bytes:
        """See Calls."""
        return bytes(self._slave.serializeFMUstate(state))

    def unpack(self, data: bytes) -> Any:
        """See Calls."""
        return self._slave.deSerializeFMUstate(data)


def _is_python(tool: str) -> bool:
    """Whether the FMUs that `tool` made are in Python, behind PythonFMU's wrapper or this project's."""
    return "PythonFMU" in tool or tool.startswith(TOOL)
