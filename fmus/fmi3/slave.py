"""A unit as the slave of pythonfmu3's binary: what runs inside an FMI 3.0 FMU.

Of pythonfmu3 only the binary is in the FMU. Its Python part would be the first one loaded in the process, whatever
version that is, for all FMUs; and what the binary calls is the few methods below.

Two rules come from that binary. An exception that leaves one of these methods ends the instance with fmi3Fatal and
damages its reference counts; so none does: it is logged, and from then on every step is refused with fmi3Error and
every Float64 reads as NaN, because no other call can return an error, until the instance is reset or goes back to a
saved state. And values cross as Python lists, a number each, which become arrays here at once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ..messages import ERROR_CATEGORY, REFUSED, WARNING_CATEGORY, category, message
from ..slave import DISCARD, ERROR, NO_INTEGER, OK, WARNING
from .instance import ArrayInstance, State

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Message:
    """A message for the host's logger, with the attributes that the binary reads."""

    status: int
    category: str
    msg: str
    debug: bool


@dataclass(frozen=True)
class StepResult:
    """What a step ends with, under the names that the binary reads; no unit ends a simulation by itself."""

    status: int
    terminateSimulation: bool = False


class Slave:
    """The slave of the unit `name`, on the mesh in the folder `resources`."""

    def __init__(self, name: str, resources: str) -> None:
        self._instance = ArrayInstance(name, resources)
        self._failed = False
        self._messages: list[Message] = []

    def _get_log_queue(self) -> list[Message]:
        # The binary empties this very list after each call.
        return self._messages

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def enter_initialization_mode(self) -> None:
        """fmi3EnterInitializationMode; the binary keeps the start and stop time to itself."""
        self._guarded(self._instance.enter_initialization_mode, None)

    def exit_initialization_mode(self) -> None:
        """fmi3ExitInitializationMode."""
        self._guarded(self._instance.exit_initialization_mode, None)

    def do_step(self, current_time: float, step_size: float) -> StepResult:
        """fmi3DoStep: fmi3Discard with the reason in the log, and the unit's state as before, if it fails."""
        self._guarded(lambda: self._instance.prepare_step(current_time), None)
        if self._failed:
            self._log(ERROR, ERROR_CATEGORY, REFUSED.format(call="step"))
            return StepResult(ERROR)
        try:
            self._instance.do_step(current_time, step_size)
        except Exception as error:
            self._log(ERROR, category(error), message(error))
            return StepResult(DISCARD)
        return StepResult(OK)

    def terminate(self) -> None:
        """fmi3Terminate."""
        self._guarded(self._instance.unit.terminate, None)

    # --- values -------------------------------------------------------------------------------------------------------

    def set_float64(self, references: list[int], values: list[float]) -> None:
        """fmi3SetFloat64."""
        self._guarded(lambda: self._instance.set_float64(references, np.array(values, np.float64)), None)

    def get_float64(self, references: list[int]) -> list[float]:
        """fmi3GetFloat64; NaN after a failure."""
        nothing = [np.nan] * self._instance.size(references)
        return nothing if self._failed else self._guarded(lambda: self._read(references), nothing)

    def set_int32(self, references: list[int], values: list[int]) -> None:
        """fmi3SetInt32: whole-number parameters."""
        self._set("Int32", references, values)

    def set_int64(self, references: list[int], values: list[int]) -> None:
        """fmi3SetInt64: no unit has such a variable; the error names the one that was meant."""
        self._set("Int64", references, values)

    def set_uint64(self, references: list[int], values: list[int]) -> None:
        """fmi3SetUInt64: no unit has such a variable."""
        self._set("UInt64", references, values)

    def set_boolean(self, references: list[int], values: list[bool]) -> None:
        """fmi3SetBoolean: no unit has such a variable."""
        self._set("Boolean", references, values)

    def set_string(self, references: list[int], values: list[str]) -> None:
        """fmi3SetString: parameters that choose between named options."""
        self._set("String", references, values)

    def get_int32(self, references: list[int]) -> list[int]:
        """fmi3GetInt32."""
        return self._get("Int32", references, NO_INTEGER)

    def get_int64(self, references: list[int]) -> list[int]:
        """fmi3GetInt64."""
        return self._get("Int64", references, NO_INTEGER)

    def get_uint64(self, references: list[int]) -> list[int]:
        """fmi3GetUInt64."""
        return self._get("UInt64", references, 0)

    def get_boolean(self, references: list[int]) -> list[bool]:
        """fmi3GetBoolean."""
        return self._get("Boolean", references, False)

    def get_string(self, references: list[int]) -> list[str]:
        """fmi3GetString."""
        return self._get("String", references, "")

    # --- state --------------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> State | None:
        return self._guarded(self._instance.get_state, None)

    def _set_fmu_state(self, state: State | None) -> None:
        # Nothing is left of what failed before.
        self._failed = False
        self._guarded(lambda: self._instance.set_state(state), None)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _read(self, references: list[int]) -> list[float]:
        values, warnings = self._instance.get_float64(references)
        for text in warnings:
            self._log(WARNING, WARNING_CATEGORY, text)
        return values.tolist()  # type: ignore[no-any-return]

    def _set(self, fmi_type: str, references: list[int], values: list[Any]) -> None:
        self._guarded(lambda: self._instance.set_parameters(fmi_type, references, values), None)

    def _get(self, fmi_type: str, references: list[int], nothing: Any) -> list[Any]:
        return self._guarded(
            lambda: self._instance.get_parameters(fmi_type, references), [nothing] * self._instance.size(references)
        )

    def _guarded(self, call: Callable[[], _Result], otherwise: _Result) -> _Result:
        try:
            return call()
        except Exception as error:
            self._failed = True
            self._log(ERROR, category(error), message(error))
            return otherwise

    def _log(self, status: int, category: str, text: str) -> None:
        # To the binary a message is for debugging if only a host that asked for a log is to have it.
        self._messages.append(Message(status, category, text, debug=status < ERROR))


def state_to_bytes(state: State | None) -> bytes:
    """fmi3SerializeFMUState."""
    return b"" if state is None else state.to_bytes()


def state_from_bytes(data: bytes) -> State | None:
    """fmi3DeserializeFMUState; None for bytes that are no state, of which fmi3SetFMUState says so."""
    try:
        return State.from_bytes(data)
    # Whatever damaged bytes trip their reader over. There is no instance to log to here.
    except Exception:
        return None
