"""A unit as pythonfmu's slave: what runs inside an FMU.

Two rules come from the wrapper around this class. An exception that leaves one of these methods ends the instance
with fmi2Fatal and damages its reference counts; so none does: it is logged, and from then on every step is refused
(fmi2Discard) and every Real reads as NaN, because the wrapper has no other way to return an error, until the instance
is reset or goes back to a saved state. And values cross as Python lists, scalar by scalar; a whole field is recognised
and moved in one piece.
"""

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from ..units.errors import InvalidInput, StepFailure
from ..units.mesh.archive import unpack_mesh
from ..units.registry import UNITS
from ..units.snapshot import Snapshot
from ..units.unit import Phase
from ..units.variable import Causality
from .layout import Run, layout

MESH_FILE = "mesh.npz"

#: Log category of an error that lies in what the caller gave, not in the physics.
INVALID_INPUT = "invalidInput"

#: What an Integer reads as after a failure, which has no NaN.
_NO_INTEGER = -(2**31)

_Result = TypeVar("_Result")


class UnitSlave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """The slave of the unit named `unit_name`, on the mesh in the FMU's resources."""

    unit_name: ClassVar[str]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName = self.unit_name
        mesh = unpack_mesh(Path(self.resources) / MESH_FILE)
        self._unit = UNITS[self.unit_name](mesh)
        self._runs = layout(type(self._unit), mesh)
        self._firsts = np.array([run.first for run in self._runs])
        self._whole = {(run.first, run.size): (run, list(range(run.first, run.first + run.size))) for run in self._runs}
        # Inputs set scalar by scalar are collected here and given to the unit in one piece before it needs them.
        self._staged: dict[str, np.ndarray] = {}
        self._read: dict[str, np.ndarray] = {}
        self._failed = False

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """fmi2SetupExperiment."""
        self._guarded(lambda: self._unit.setup_experiment(start_time, stop_time), None)

    def enter_initialization_mode(self) -> None:
        """fmi2EnterInitializationMode."""
        self._guarded(self._unit.enter_initialization_mode, None)

    def exit_initialization_mode(self) -> None:
        """fmi2ExitInitializationMode."""
        self._guarded(lambda: self._advance(self._unit.exit_initialization_mode), None)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """fmi2DoStep; False makes it fmi2Discard, with the reason in the log and the unit's state as before."""
        # An input that is wrong is an error of the call that set it, not of this step: trying again does not help.
        self._guarded(self._flush, None)
        if self._failed:
            self.log(
                "the step is refused because an earlier call failed; reset the instance or restore a saved state",
                Fmi2Status.error,
            )
            return False
        try:
            self._advance(lambda: self._unit.do_step(current_time, step_size))
        except Exception as error:
            self._log_failure(error)
            return False
        return True

    def terminate(self) -> None:
        """fmi2Terminate."""
        self._guarded(self._unit.terminate, None)

    # --- values -------------------------------------------------------------------------------------------------------

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """fmi2SetReal: whole fields at once, or any scalars."""
        self._guarded(lambda: self._set("Real", vrs, values), None)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """fmi2SetInteger: whole-number parameters."""
        self._guarded(lambda: self._set("Integer", vrs, values), None)

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """fmi2SetBoolean: no unit has such a variable; the error names the one that was meant."""
        self._guarded(lambda: self._set("Boolean", vrs, values), None)

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """fmi2SetString: parameters that choose between named options."""
        self._guarded(lambda: self._set("String", vrs, values), None)

    def get_real(self, vrs: list[int]) -> list[float]:
        """fmi2GetReal: whole fields at once, or any scalars; NaN after a failure."""
        return self._guarded(lambda: self._get(vrs), [np.nan] * len(vrs))

    def get_integer(self, vrs: list[int]) -> list[int]:
        """fmi2GetInteger."""
        return self._guarded(lambda: [self._scalar("Integer", vr) for vr in vrs], [_NO_INTEGER] * len(vrs))

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """fmi2GetBoolean."""
        return self._guarded(lambda: [self._scalar("Boolean", vr) for vr in vrs], [False] * len(vrs))

    def get_string(self, vrs: list[int]) -> list[str]:
        """fmi2GetString."""
        return self._guarded(lambda: [self._scalar("String", vr) for vr in vrs], [""] * len(vrs))

    # --- state --------------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> Snapshot | None:
        return self._guarded(lambda: self._advance(self._unit.get_state), None)

    def _set_fmu_state(self, state: Snapshot | None) -> None:
        def restore() -> None:
            if state is None:
                raise InvalidInput("the state given to fmi2SetFMUstate is none of this FMU")
            self._staged.clear()
            self._unit.set_state(state)
            # The state holds every input as well: nothing is left of what failed.
            self._failed = False

        self._read.clear()
        self._guarded(restore, None)

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

    def _set(self, fmi_type: str, vrs: list[int], values: list[Any]) -> None:
        whole = self._whole.get((vrs[0], len(vrs))) if vrs else None
        if whole is not None and whole[1] == vrs:
            run = self._run(vrs[0], fmi_type)
            self._staged.pop(run.variable.name, None)
            self._read.pop(run.variable.name, None)
            self._unit.set(run.variable.name, values[0] if not run.shape else np.array(values).reshape(run.shape))
            return
        for vr, value in zip(vrs, values, strict=True):
            run = self._run(vr, fmi_type)
            if run.variable.causality is Causality.PARAMETER:
                self._read.pop(run.variable.name, None)
                self._unit.set(run.variable.name, value)
            else:
                self._stage(run)[vr - run.first] = value

    def _stage(self, run: Run) -> np.ndarray:
        name = run.variable.name
        if name not in self._staged:
            if run.variable.causality is not Causality.INPUT:
                raise InvalidInput(f"'{name}' is an output and cannot be set")
            self._staged[name] = np.array(self._unit.get(name), dtype=float).ravel()
            self._read.pop(name, None)
        return self._staged[name]

    def _flush(self) -> None:
        while self._staged:
            name, values = self._staged.popitem()
            self._unit.set(name, values.reshape(self._unit.variable(name).shape(self._unit.mesh)))

    def _advance(self, call: Callable[[], _Result]) -> _Result:
        self._flush()
        self._read.clear()
        return call()

    def _get(self, vrs: list[int]) -> list[float]:
        if self._failed:
            return [np.nan] * len(vrs)
        self._flush()
        whole = self._whole.get((vrs[0], len(vrs))) if vrs else None
        if whole is not None and whole[1] == vrs:
            return self._values(self._run(vrs[0], "Real")).tolist()
        references = np.array(vrs, dtype=np.int64)
        values = np.empty(len(vrs))
        owner = np.searchsorted(self._firsts, references, side="right") - 1
        for number in np.unique(owner):
            run = self._run(int(references[owner == number].max()), "Real")
            values[owner == number] = self._values(run)[references[owner == number] - run.first]
        return values.tolist()

    def _values(self, run: Run) -> np.ndarray:
        name = run.variable.name
        if run.variable.causality is Causality.OUTPUT and self._unit.phase not in (Phase.STEPPING, Phase.TERMINATED):
            self.log(
                f"'{name}' has no value before the initialization is complete; it reads as NaN", Fmi2Status.warning
            )
            return np.full(run.size, np.nan)
        if name not in self._read:
            self._read[name] = np.asarray(self._unit.get(name), dtype=float).reshape(-1)
        return self._read[name]

    def _scalar(self, fmi_type: str, vr: int) -> Any:
        return self._unit.get(self._run(vr, fmi_type).variable.name)

    def _run(self, vr: int, fmi_type: str) -> Run:
        """The run that holds `vr`, which has to be of the type that the caller took it for."""
        run = self._runs[int(np.searchsorted(self._firsts, vr, side="right")) - 1]
        if not run.first <= vr < run.first + run.size:
            raise InvalidInput(f"unit '{self.unit_name}' has no value reference {vr}")
        if run.fmi_type != fmi_type:
            raise InvalidInput(
                f"value reference {vr}, '{run.variable.name}', is of type {run.fmi_type}, not {fmi_type}"
            )
        return run

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
        if isinstance(error, InvalidInput):
            self.log(str(error), Fmi2Status.error, INVALID_INPUT)
        elif isinstance(error, StepFailure):
            self.log(str(error), Fmi2Status.error)
        else:
            # The reason comes first: some hosts cut a message off (FMPy after 2047 characters).
            reason = "".join(traceback.format_exception_only(error))
            self.log(reason + "".join(traceback.format_exception(error)), Fmi2Status.error)
