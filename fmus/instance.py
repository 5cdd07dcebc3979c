"""A unit as an instance of its FMU: FMI's calls with value references, in NumPy arrays; what is wrong is raised.

What a wrapper makes of exceptions is said in `slave` (this project's own wrapper) and in `pythonfmu_slave`.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..units.errors import InvalidInput, StepFailure
from ..units.mesh.archive import unpack_mesh
from ..units.registry import UNITS
from ..units.snapshot import Snapshot
from ..units.unit import Phase
from ..units.variable import Causality
from .layout import Run, layout

MESH_FILE = "mesh.npz"

_Result = TypeVar("_Result")


class UnitInstance:
    """The unit `name` on the mesh in the folder `resources`.

    Whole fields move in one piece. Inputs that are set scalar by scalar are collected, and given to the unit before it
    needs them. All methods raise InvalidInput for what the caller got wrong.
    """

    def __init__(self, name: str, resources: str) -> None:
        mesh = unpack_mesh(Path(resources) / MESH_FILE)
        self.unit = UNITS[name](mesh)
        self._runs = layout(type(self.unit), mesh)
        self._firsts = np.array([run.first for run in self._runs])
        self._whole = {(run.first, run.size): run for run in self._runs}
        # Compared with at every call: in the type in which they come, and made once.
        self._references = {key: np.arange(key[0], sum(key), dtype=np.uint32) for key in self._whole}
        self._staged: dict[str, np.ndarray] = {}
        self._read: dict[str, np.ndarray] = {}

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def exit_initialization_mode(self) -> None:
        """fmi2ExitInitializationMode."""
        self._advance(self.unit.exit_initialization_mode)

    def flush(self) -> None:
        """Give the unit the inputs that were set scalar by scalar."""
        while self._staged:
            name, values = self._staged.popitem()
            self.unit.set(name, values.reshape(self.unit.variable(name).shape(self.unit.mesh)))

    def do_step(self, time: float, step: float) -> None:
        """fmi2DoStep; StepFailure leaves the state as it was."""
        self._advance(lambda: self.unit.do_step(time, step))

    def reset(self) -> None:
        """fmi2Reset."""
        self._staged.clear()
        self._read.clear()
        self.unit.reset()

    # --- values -------------------------------------------------------------------------------------------------------

    def set_reals(self, references: np.ndarray, values: np.ndarray) -> None:
        """fmi2SetReal; the arrays, shape (n,), are the caller's and are copied."""
        self._forget_foreseen()
        run = self._whole_run(references)
        if run is not None:
            self._expect(run, int(references[0]), "Real")
            self._staged.pop(run.variable.name, None)
            self._read.pop(run.variable.name, None)
            whole = float(values[0]) if not run.shape else np.array(values).reshape(run.shape)
            self.unit.set(run.variable.name, whole)
            return
        for reference, value in zip(references.tolist(), values.tolist(), strict=True):
            run = self._run(reference, "Real")
            if run.variable.causality is Causality.PARAMETER:
                self._read.pop(run.variable.name, None)
                self.unit.set(run.variable.name, value)
            else:
                self._stage(run)[reference - run.first] = value

    def get_reals(self, references: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """fmi2GetReal: values, shape (n,), not to be written to, and warnings of values that there are not yet."""
        self.flush()
        warnings: list[str] = []
        run = self._whole_run(references)
        if run is not None:
            self._expect(run, int(references[0]), "Real")
            return self._values(run, warnings), warnings
        values = np.empty(len(references))
        owner = np.searchsorted(self._firsts, references, side="right") - 1
        for number in np.unique(owner):
            run = self._run(int(references[owner == number].max()), "Real")
            values[owner == number] = self._values(run, warnings)[references[owner == number] - run.first]
        return values, warnings

    def set_scalars(self, fmi_type: str, references: Sequence[int], values: Sequence[Any]) -> None:
        """fmi2SetInteger, fmi2SetBoolean and fmi2SetString: parameters only."""
        self._forget_foreseen()
        for reference, value in zip(references, values, strict=True):
            run = self._run(reference, fmi_type)
            self.unit.set(run.variable.name, value)

    def get_scalars(self, fmi_type: str, references: Sequence[int]) -> list[Any]:
        """fmi2GetInteger, fmi2GetBoolean and fmi2GetString."""
        return [self.unit.get(self._run(reference, fmi_type).variable.name) for reference in references]

    # --- state --------------------------------------------------------------------------------------------------------

    def get_state(self) -> Snapshot:
        """fmi2GetFMUstate."""
        return self._advance(self.unit.get_state)

    def set_state(self, state: Snapshot | None) -> None:
        """fmi2SetFMUstate; the state holds every input as well."""
        self._read.clear()
        if state is None:
            raise InvalidInput("the state given to fmi2SetFMUstate is none of this FMU")
        self._staged.clear()
        self.unit.set_state(state)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _advance(self, call: Callable[[], _Result]) -> _Result:
        self.flush()
        self._read.clear()
        return call()

    def _forget_foreseen(self) -> None:
        # During the initialization outputs follow whatever is set; afterwards they change in steps only.
        if self.unit.phase is Phase.INITIALIZATION:
            self._read.clear()

    def _stage(self, run: Run) -> np.ndarray:
        name = run.variable.name
        if name not in self._staged:
            if run.variable.causality is not Causality.INPUT:
                raise InvalidInput(f"'{name}' is {run.variable.causality} and cannot be set")
            self._staged[name] = np.array(self.unit.get(name), dtype=float).ravel()
            self._read.pop(name, None)
        return self._staged[name]

    def _values(self, run: Run, warnings: list[str]) -> np.ndarray:
        name = run.variable.name
        if name not in self._read:
            value = self._output(name, warnings) if run.variable.causality is Causality.OUTPUT else self.unit.get(name)
            if value is None:
                return np.full(run.size, np.nan)
            self._read[name] = np.asarray(value, dtype=float).reshape(-1)
        return self._read[name]

    def _output(self, name: str, warnings: list[str]) -> Any:
        """An output; None, with a warning, if it has no value yet."""
        if self.unit.phase is Phase.INSTANTIATED:
            warnings.append(f"'{name}' has no value before the initialization; it reads as NaN")
            return None
        if self.unit.phase is not Phase.INITIALIZATION:
            return self.unit.get(name)
        try:
            return self.unit.get(name)
        except (InvalidInput, StepFailure) as error:
            warnings.append(
                f"'{name}' has no value as long as the initialization cannot end ({error}); it reads as NaN"
            )
            return None

    def _whole_run(self, references: np.ndarray) -> Run | None:
        """The run whose value references these are, all of them in their order."""
        key = (int(references[0]), len(references)) if len(references) else None
        if key not in self._whole or not (references == self._references[key]).all():
            return None
        return self._whole[key]

    def _run(self, reference: int, fmi_type: str) -> Run:
        """The run that holds `reference`, which has to be of the type that the caller took it for."""
        run = self._runs[int(np.searchsorted(self._firsts, reference, side="right")) - 1]
        if not run.first <= reference < run.first + run.size:
            raise InvalidInput(f"unit '{self.unit.name}' has no value reference {reference}")
        self._expect(run, reference, fmi_type)
        return run

    @staticmethod
    def _expect(run: Run, reference: int, fmi_type: str) -> None:
        if run.fmi_type != fmi_type:
            raise InvalidInput(
                f"value reference {reference}, '{run.variable.name}', is of type {run.fmi_type}, not {fmi_type}"
            )
