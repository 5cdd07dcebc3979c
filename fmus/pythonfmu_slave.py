"""A unit as pythonfmu's slave: what runs inside an FMU where this project's own wrapper could not be compiled.

Two rules come from pythonfmu's wrapper. An exception that leaves one of these methods ends the instance with fmi2Fatal
and damages its reference counts; so none does: it is logged, and from then on every step is refused (fmi2Discard) and
every Real reads as NaN, because the wrapper has no other way to return an error, until the instance is reset or goes
back to a saved state. And values cross as Python lists, scalar by scalar.
"""

from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from ..units.snapshot import Snapshot
from .instance import UnitInstance
from .messages import REFUSED, category, message
from .slave import NO_INTEGER

_Result = TypeVar("_Result")


class PythonFmuSlave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """The slave of the unit named `unit_name`, on the mesh in the FMU's resources."""

    unit_name: ClassVar[str]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName = self.unit_name
        self._instance = UnitInstance(self.unit_name, self.resources)
        self._failed = False

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """fmi2SetupExperiment."""
        self._guarded(lambda: self._instance.unit.setup_experiment(start_time, stop_time), None)

    def enter_initialization_mode(self) -> None:
        """fmi2EnterInitializationMode."""
        self._guarded(self._instance.unit.enter_initialization_mode, None)

    def exit_initialization_mode(self) -> None:
        """fmi2ExitInitializationMode."""
        self._guarded(self._instance.exit_initialization_mode, None)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """fmi2DoStep; False makes it fmi2Discard, with the reason in the log and the unit's state as before."""
        # An input that is wrong is an error of the call that set it, not of this step: trying again does not help.
        self._guarded(self._instance.flush, None)
        if self._failed:
            self.log(REFUSED.format(call="step"), Fmi2Status.error)
            return False
        try:
            self._instance.do_step(current_time, step_size)
        except Exception as error:
            self._log_failure(error)
            return False
        return True

    def terminate(self) -> None:
        """fmi2Terminate."""
        self._guarded(self._instance.unit.terminate, None)

    # --- values -------------------------------------------------------------------------------------------------------

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """fmi2SetReal: whole fields at once, or any scalars."""
        self._guarded(lambda: self._instance.set_reals(np.array(vrs, np.int64), np.array(values, np.float64)), None)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """fmi2SetInteger: whole-number parameters."""
        self._guarded(lambda: self._instance.set_scalars("Integer", vrs, values), None)

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """fmi2SetBoolean: no unit has such a variable; the error names the one that was meant."""
        self._guarded(lambda: self._instance.set_scalars("Boolean", vrs, values), None)

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """fmi2SetString: parameters that choose between named options."""
        self._guarded(lambda: self._instance.set_scalars("String", vrs, values), None)

    def get_real(self, vrs: list[int]) -> list[float]:
        """fmi2GetReal: whole fields at once, or any scalars; NaN after a failure."""
        if self._failed:
            return [np.nan] * len(vrs)

        def read() -> list[float]:
            values, warnings = self._instance.get_reals(np.array(vrs, np.int64))
            for warning in warnings:
                self.log(warning, Fmi2Status.warning)
            return values.tolist()  # type: ignore[no-any-return]

        return self._guarded(read, [np.nan] * len(vrs))

    def get_integer(self, vrs: list[int]) -> list[int]:
        """fmi2GetInteger."""
        return self._guarded(lambda: self._instance.get_scalars("Integer", vrs), [NO_INTEGER] * len(vrs))

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """fmi2GetBoolean."""
        return self._guarded(lambda: self._instance.get_scalars("Boolean", vrs), [False] * len(vrs))

    def get_string(self, vrs: list[int]) -> list[str]:
        """fmi2GetString."""
        return self._guarded(lambda: self._instance.get_scalars("String", vrs), [""] * len(vrs))

    # --- state --------------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> Snapshot | None:
        return self._guarded(self._instance.get_state, None)

    def _set_fmu_state(self, state: Snapshot | None) -> None:
        # Nothing is left of what failed before.
        self._failed = False
        self._guarded(lambda: self._instance.set_state(state), None)

    @staticmethod
    def _fmu_state_to_bytes(state: Snapshot | None) -> bytes:
        return b"" if state is None else state.to_bytes()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> Snapshot | None:
        try:
            return Snapshot.from_bytes(state)
        # Whatever damaged bytes trip their reader over.
        except Exception:
            # There is no instance to log to here; fmi2SetFMUstate says what is wrong.
            return None

    # --- inside -------------------------------------------------------------------------------------------------------

    def _guarded(self, call: Callable[[], _Result], otherwise: _Result) -> _Result:
        try:
            return call()
        except Exception as error:
            self._failed = True
            self._log_failure(error)
            return otherwise

    def log(self, msg: str, status: Fmi2Status = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """See Fmi2Slave. In FMI 2.0 a message is a printf format: a percent sign has to be written twice."""
        super().log(msg.replace("%", "%%"), status, category)

    def _log_failure(self, error: Exception) -> None:
        self.log(message(error), Fmi2Status.error, category(error))
