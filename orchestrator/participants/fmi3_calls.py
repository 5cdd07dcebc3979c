"""The calls of an FMI 3.0 co-simulation FMU, through FMPy. An array crosses in one piece, by one value reference.

Event mode and early return are not asked for: the FMU handles its events inside of a step (FMI 3.0, section 4.2.1).
"""

from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import Any

from fmpy.fmi3 import FMU3Slave

from ..errors import ParticipantError, ParticipantTerminated
from .fmu_log import FmuLog
from .fmu_variables import Field
from .participant import Ramp


class Fmi3Calls:
    """See Calls."""

    by_derivatives = False

    def __init__(self, description: Any) -> None:
        # Not the description itself: that of a heart holds some ten thousand variables.
        self._guid, self._model = description.guid, description.coSimulation.modelIdentifier
        self._slave: Any = None
        self.log = FmuLog()
        self._asks = description.coSimulation.canInterpolateInputs
        inputs = (item for item in description.modelVariables if item.causality == "input")
        self._intermediate = [item.valueReference for item in inputs if item.intermediateUpdate] if self._asks else []
        # The inputs that run over the step, its times, and what went wrong where the FMU asked for them.
        self._ramps: Sequence[tuple[Field, Ramp]] = ()
        self._step = (0.0, 0.0)
        self._trouble: Exception | None = None

    def instantiate(self, folder: Path, name: str) -> None:
        """See Calls."""
        slave = FMU3Slave(
            guid=self._guid,
            unzipDirectory=str(folder),
            modelIdentifier=self._model,
            instanceName=name,
        )
        slave.instantiate(
            loggingOn=True,
            logMessage=self._hear,
            intermediateUpdate=self._update if self._intermediate else None,
            requiredIntermediateVariables=self._intermediate,
        )
        self._slave = slave

    def free_instance(self) -> None:
        """See Calls."""
        self._slave.freeInstance()

    def setup_experiment(self, start: float) -> None:
        """See Calls; in FMI 3.0 the experiment begins with the initialization mode."""

    def enter_initialization_mode(self, start: float) -> None:
        """See Calls."""
        self._slave.enterInitializationMode(startTime=start)

    def exit_initialization_mode(self) -> None:
        """See Calls."""
        self._slave.exitInitializationMode()

    def terminate(self) -> None:
        """See Calls."""
        self._slave.terminate()

    def set(self, field: Field) -> None:
        """See Calls."""
        call = getattr(self._slave, f"fmi3Set{field.kind}")
        call(self._slave.component, field.references, len(field.references), field.buffer, field.size)

    def get(self, field: Field) -> None:
        """See Calls."""
        call = getattr(self._slave, f"fmi3Get{field.kind}")
        call(self._slave.component, field.references, len(field.references), field.buffer, field.size)

    def set_derivative(self, field: Field, order: int) -> None:
        """See Calls."""
        raise TypeError("FMI 3.0 has no input derivatives")

    def run(self, ramps: Sequence[tuple[Field, Ramp]]) -> None:
        """See Calls."""
        self._ramps = ramps

    def set_start(self, variable: Any, value: Any) -> None:
        """See Calls."""
        # An enumeration is set as an Int64 (FMI 3.0, section 2.4.4).
        kind = "Int64" if variable.type == "Enumeration" else variable.type
        values = value if isinstance(value, list) else [value] * prod(variable.shape)
        getattr(self._slave, f"set{kind}")([variable.valueReference], values)

    def step(self, time: float, size: float) -> None:
        """See Calls."""
        # True: the master goes back to the step's begin at most, which is not prior to it (section 4.2.1).
        self._step, self._trouble = (time, size), None
        try:
            _, terminate, early, reached = self._slave.doStep(time, size, True)
        finally:
            self._ramps = ()
            trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble
        if terminate:
            end = ParticipantTerminated("it requested the end of the simulation (terminateSimulation)")
            end.time_s = reached
            raise end
        if early:
            raise ParticipantError(
                f"it returned from its step early, at {reached:g} s, although that is not allowed (earlyReturnAllowed)"
            )

    def save(self) -> Any:
        """See Calls."""
        return self._slave.getFMUState()

    def restore(self, state: Any) -> None:
        """See Calls."""
        self._slave.setFMUState(state)

    def free(self, state: Any) -> None:
        """See Calls."""
        self._slave.freeFMUState(state)

    def pack(self, state: Any) -> bytes:
        """See Calls."""
        return bytes(self._slave.serializeFMUState(state))

    def unpack(self, data: bytes) -> Any:
        """See Calls."""
        return self._slave.deserializeFMUState(data)

    def _update(
        self,
        _environment: Any,
        time: float,
        may_set: bool,
        _may_get: bool,
        _finished: bool,
        _may_return: bool,
        early: Any,
        _early_time: Any,
    ) -> None:
        """Set the inputs to what they are at a `time` inside the step (FMI 3.0, section 4.2.1)."""
        early[0] = False
        if not may_set:
            return
        begin, size = self._step
        # In the FMU's sum of the two its end is met to the bit.
        offset = size if time == begin + size else time - begin
        try:
            for field, ramp in self._ramps:
                field.fill(ramp.value(offset, size))
                self.set(field)
        # It cannot pass through the FMU.
        except Exception as error:
            self._trouble = error

    def _hear(self, _environment: Any, status: int, category: bytes | None, message: bytes | None) -> None:
        self.log.hear(status, category or b"", message or b"")
