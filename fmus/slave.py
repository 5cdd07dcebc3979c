"""A unit as the slave of this project's own wrapper (`wrapper/`): what runs inside an FMU.

Every method returns (status, value, messages) and raises nothing. A mistake of the caller is fmi2Error, and so is what
follows it until the instance is reset or goes back to a saved state; Reals that could not be read are NaN, for hosts
that do not look at the status. A step that fails is fmi2Discard and leaves the unit as it was.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..units.snapshot import Snapshot
from .instance import UnitInstance
from .messages import ERROR_CATEGORY, REFUSED, WARNING_CATEGORY, category, message

#: fmi2Status.
OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3

#: What an Integer reads as that could not be read, for it has no NaN.
NO_INTEGER = -(2**31)

Answer = tuple[int, Any, list[tuple[int, str, str]]]

_FINE: Answer = (OK, None, [])


class Slave:
    """The slave of the unit `name`, on the mesh in the folder `resources`."""

    def __init__(self, name: str, resources: str) -> None:
        self._instance = UnitInstance(name, resources)
        self._failed = False

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float) -> Answer:
        """fmi2SetupExperiment; a stop time that is not defined is infinite."""
        return self._guarded(lambda: self._instance.unit.setup_experiment(start_time, stop_time))

    def enter_initialization_mode(self) -> Answer:
        """fmi2EnterInitializationMode."""
        return self._guarded(self._instance.unit.enter_initialization_mode)

    def exit_initialization_mode(self) -> Answer:
        """fmi2ExitInitializationMode."""
        return self._guarded(self._instance.exit_initialization_mode)

    def do_step(self, time: float, size: float) -> Answer:
        """fmi2DoStep."""
        # An input that is wrong is an error of the call that set it, not of this step: trying again does not help.
        flushed = self._guarded(self._instance.flush, "step")
        if flushed[0] == ERROR:
            return flushed
        try:
            self._instance.do_step(time, size)
        except Exception as error:
            return DISCARD, None, [(ERROR, category(error), message(error))]
        return _FINE

    def terminate(self) -> Answer:
        """fmi2Terminate."""
        return self._guarded(self._instance.unit.terminate)

    def reset(self) -> Answer:
        """fmi2Reset."""
        self._failed = False
        return self._guarded(self._instance.reset)

    # --- values -------------------------------------------------------------------------------------------------------

    def set_real(self, references: memoryview, values: memoryview) -> Answer:
        """fmi2SetReal: whole fields at once, or any scalars."""
        return self._guarded(
            lambda: self._instance.set_reals(_references(references), np.frombuffer(values, np.float64))
        )

    def get_real(self, references: memoryview, values: memoryview) -> Answer:
        """fmi2GetReal: whole fields at once, or any scalars."""
        target = np.frombuffer(values, np.float64)
        warnings: list[str] = []

        def read() -> None:
            found, told = self._instance.get_reals(_references(references))
            target[:] = found
            warnings.extend(told)

        answer = self._guarded(read, "value")
        if answer[0] == ERROR:
            target[:] = np.nan
        elif warnings:
            return WARNING, None, [(WARNING, WARNING_CATEGORY, text) for text in warnings]
        return answer

    def set_integer(self, references: memoryview, values: memoryview) -> Answer:
        """fmi2SetInteger: whole-number parameters."""
        return self._set("Integer", references, np.frombuffer(values, np.int32).tolist())

    def set_boolean(self, references: memoryview, values: memoryview) -> Answer:
        """fmi2SetBoolean: no unit has such a variable; the error names the one that was meant."""
        return self._set("Boolean", references, np.frombuffer(values, np.int32).astype(bool).tolist())

    def set_string(self, references: memoryview, values: list[str]) -> Answer:
        """fmi2SetString: parameters that choose between named options."""
        return self._set("String", references, values)

    def get_integer(self, references: memoryview, values: memoryview) -> Answer:
        """fmi2GetInteger."""
        return self._get_numbers("Integer", references, values)

    def get_boolean(self, references: memoryview, values: memoryview) -> Answer:
        """fmi2GetBoolean."""
        return self._get_numbers("Boolean", references, values)

    def get_string(self, references: memoryview) -> Answer:
        """fmi2GetString; the value is a list of bytes in UTF-8."""
        texts: list[bytes] = []

        def read() -> None:
            found = self._instance.get_scalars("String", _references(references).tolist())
            texts.extend(text.encode() for text in found)

        status, _, messages = self._guarded(read, "value")
        return status, texts, messages

    # --- state --------------------------------------------------------------------------------------------------------

    def get_state(self) -> Answer:
        """fmi2GetFMUstate."""
        states: list[Snapshot] = []
        status, _, messages = self._guarded(lambda: states.append(self._instance.get_state()), "state")
        return status, states[0] if states else None, messages

    def set_state(self, state: Snapshot | None) -> Answer:
        """fmi2SetFMUstate: nothing is left of what failed before."""
        self._failed = False
        return self._guarded(lambda: self._instance.set_state(state))

    def state_to_bytes(self, state: Snapshot | None) -> Answer:
        """fmi2SerializeFMUstate."""
        return OK, b"" if state is None else state.to_bytes(), []

    def state_from_bytes(self, data: bytes) -> Answer:
        """fmi2DeSerializeFMUstate; possible also after a failure, for a saved state is the way back from it."""
        try:
            return OK, Snapshot.from_bytes(data), []
        # Whatever damaged bytes trip their reader over.
        except Exception as error:
            self._failed = True
            return ERROR, None, [(ERROR, category(error), f"these bytes are no state of an FMU: {error}")]

    # --- inside -------------------------------------------------------------------------------------------------------

    def _set(self, fmi_type: str, references: memoryview, values: list[Any]) -> Answer:
        return self._guarded(lambda: self._instance.set_scalars(fmi_type, _references(references).tolist(), values))

    def _get_numbers(self, fmi_type: str, references: memoryview, values: memoryview) -> Answer:
        target = np.frombuffer(values, np.int32)

        def read() -> None:
            target[:] = self._instance.get_scalars(fmi_type, _references(references).tolist())

        answer = self._guarded(read, "value")
        if answer[0] == ERROR:
            target[:] = NO_INTEGER
        return answer

    def _guarded(self, call: Callable[[], None], refusing: str = "call") -> Answer:
        """`call`, unless an earlier one failed; `refusing` is what the host is told to be refused then."""
        if self._failed:
            return ERROR, None, [(ERROR, ERROR_CATEGORY, REFUSED.format(call=refusing))]
        try:
            call()
        except Exception as error:
            self._failed = True
            return ERROR, None, [(ERROR, category(error), message(error))]
        return _FINE


def _references(view: memoryview) -> np.ndarray:
    return np.frombuffer(view, np.uint32)
