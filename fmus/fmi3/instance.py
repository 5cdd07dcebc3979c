"""A unit as an instance of its FMI 3.0 FMU: whole variables by their value references; what is wrong is raised."""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...units.errors import InvalidInput
from ...units.snapshot import Snapshot
from ..instance import UnitInstance
from ..layout import layout as scalar_layout
from .layout import TIME, Entry, layout

_TIME_FORMAT = struct.Struct("<d")

#: What the inner instance, made for FMI 2.0, calls the types of parameters that are no real numbers.
_FMI2_TYPES = {"Int32": "Integer", "String": "String"}


@dataclass(frozen=True)
class State:
    """What fmi3GetFMUState saves: the unit's own snapshot and the time in s that it has come to."""

    time: float
    snapshot: Snapshot

    def to_bytes(self) -> bytes:
        """The state as bytes."""
        return _TIME_FORMAT.pack(self.time) + self.snapshot.to_bytes()

    @classmethod
    def from_bytes(cls, data: bytes) -> "State":
        """What `to_bytes` made; InvalidInput for other bytes."""
        if len(data) < _TIME_FORMAT.size:
            raise InvalidInput("the bytes are no serialized state of a unit (too few)")
        (time,) = _TIME_FORMAT.unpack_from(data)
        return cls(time, Snapshot.from_bytes(data[_TIME_FORMAT.size :]))


class ArrayInstance:
    """The unit `name` on the mesh in the folder `resources`, as `UnitInstance` holds it, with FMI 3.0's references.

    A variable is set and read whole, in one piece. All methods raise InvalidInput for what the caller got wrong.
    """

    def __init__(self, name: str, resources: str) -> None:
        self._inner = UnitInstance(name, resources)
        self.unit = self._inner.unit
        kind, mesh = type(self.unit), self.unit.mesh
        self._entries = {entry.reference: entry for entry in layout(kind, mesh)}
        # Of each variable the references by which the inner instance, made for FMI 2.0, knows its scalars.
        runs = scalar_layout(kind, mesh)
        self._scalars = {run.variable.name: np.arange(run.first, run.first + run.size, dtype=np.uint32) for run in runs}
        self.time = 0.0

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def enter_initialization_mode(self) -> None:
        """fmi3EnterInitializationMode, whose start time is 0: a unit's physics starts there."""
        self.unit.setup_experiment()
        self.unit.enter_initialization_mode()

    def exit_initialization_mode(self) -> None:
        """fmi3ExitInitializationMode."""
        self._inner.exit_initialization_mode()

    def prepare_step(self, time: float) -> None:
        """Refuse a first step that begins elsewhere than a unit's physics; one without memory may begin anywhere."""
        if self.time == 0.0 != time and not self.unit.memoryless:
            raise InvalidInput(f"unit '{self.unit.name}' starts at t = 0 s, not at {time} s")

    def do_step(self, time: float, step: float) -> None:
        """fmi3DoStep; StepFailure leaves the state as it was."""
        self._inner.do_step(time, step)
        self.time = time + step

    # --- values -------------------------------------------------------------------------------------------------------

    def set_float64(self, references: list[int], values: np.ndarray) -> None:
        """fmi3SetFloat64; `values`, shape (n,), are those of all variables, one after the other, and are copied."""
        entries = [self._entry(reference, "Float64") for reference in references]
        expected = sum(entry.size for entry in entries)
        if len(values) != expected:
            names = ", ".join(f"'{entry.variable.name}'" for entry in entries)
            raise InvalidInput(f"unit '{self.unit.name}' got {len(values)} values for {names}, expected {expected}")
        begin = 0
        for entry in entries:
            self._inner.set_reals(self._scalars[entry.variable.name], values[begin : begin + entry.size])
            begin += entry.size

    def get_float64(self, references: list[int]) -> tuple[np.ndarray, list[str]]:
        """fmi3GetFloat64: values of all variables one after the other, shape (n,), and warnings of missing ones."""
        parts, warnings = [], []
        for reference in references:
            if reference == TIME:
                parts.append(np.array([self.time]))
                continue
            entry = self._entry(reference, "Float64")
            part, told = self._inner.get_reals(self._scalars[entry.variable.name])
            parts.append(part)
            warnings.extend(told)
        return parts[0] if len(parts) == 1 else np.concatenate([np.empty(0), *parts]), warnings

    def size(self, references: list[int]) -> int:
        """How many values `references` have together; one each for those that are none."""
        return sum(self._entries[each].size if each in self._entries else 1 for each in references)

    def set_parameters(self, fmi_type: str, references: list[int], values: list[Any]) -> None:
        """fmi3SetInt32, fmi3SetString and the setters of types that no unit has, whose error names the variable."""
        for reference, value in zip(references, values, strict=True):
            name = self._entry(reference, fmi_type).variable.name
            self._inner.set_scalars(_FMI2_TYPES[fmi_type], [int(self._scalars[name][0])], [value])

    def get_parameters(self, fmi_type: str, references: list[int]) -> list[Any]:
        """fmi3GetInt32, fmi3GetString and so on."""
        return [self.unit.get(self._entry(reference, fmi_type).variable.name) for reference in references]

    # --- state --------------------------------------------------------------------------------------------------------

    def get_state(self) -> State:
        """fmi3GetFMUState."""
        return State(self.time, self._inner.get_state())

    def set_state(self, state: State | None) -> None:
        """fmi3SetFMUState."""
        if not isinstance(state, State):
            raise InvalidInput("the state given to fmi3SetFMUState is none of this FMU")
        self._inner.set_state(state.snapshot)
        self.time = state.time

    # --- inside -------------------------------------------------------------------------------------------------------

    def _entry(self, reference: int, fmi_type: str) -> Entry:
        """The variable of `reference`, which has to be of the type that the caller took it for."""
        if reference == TIME:
            raise InvalidInput(f"value reference {TIME}, 'time', is a Float64 that can be read only")
        if reference not in self._entries:
            raise InvalidInput(f"unit '{self.unit.name}' has no value reference {reference}")
        entry = self._entries[reference]
        if entry.fmi_type != fmi_type:
            raise InvalidInput(
                f"value reference {reference}, '{entry.variable.name}', is of type {entry.fmi_type}, not {fmi_type}"
            )
        return entry
