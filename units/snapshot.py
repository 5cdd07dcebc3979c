"""A unit's state, saved: to go back to it within a process, or as bytes in another one."""

import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from .arrays import FloatArray, frozen
from .errors import InvalidInput
from .mesh import Mesh
from .phase import Phase
from .taken import Taken
from .variable import Scalar, Variable

State = Mapping[str, FloatArray]

_FORMAT = 3


@dataclass(frozen=True)
class Snapshot:
    """All that a unit needs to go on from a moment. The arrays are never changed in place.

    `mesh` is the fingerprint of the mesh it belongs to; `parameters` are those that differ from what is declared, or
    were given all the same. `taken` is there for units that have derivatives, once they are initialised.
    """

    unit: str
    mesh: str
    phase: Phase
    parameters: Mapping[str, Scalar]
    inputs: State
    state: State
    taken: Taken | None = None

    def check_fits(self, unit: str, mesh: Mesh, inputs: Iterable[Variable], state: State) -> None:
        """InvalidInput for a snapshot of another `unit`, of another `mesh`, or with arrays that are none of its.

        `inputs` are those of the unit; `state` is one of its states with these parameters, or empty.
        """
        if self.unit != unit:
            raise InvalidInput(f"a state of unit '{self.unit}' was given to unit '{unit}'")
        if self.mesh != mesh.fingerprint:
            raise InvalidInput(f"the state given to unit '{unit}' belongs to another mesh")
        declared = {variable.name: variable.shape(mesh) for variable in inputs}
        given, stored = _shapes(self.inputs), _shapes(self.state)
        # Before initialization mode there are those that were set; later there are all of them.
        expected = {name: declared.get(name) for name in given} if self.phase is Phase.INSTANTIATED else declared
        if given != expected:
            raise InvalidInput(f"the input arrays of the state do not fit unit '{unit}'")
        if bool(stored) != self.phase.initialized or (stored and state and stored != _shapes(state)):
            raise InvalidInput(f"the state arrays of the state do not fit unit '{unit}'")
        if self.taken is not None:
            before, begin, ends = (_shapes(group) for group in (self.taken.before, self.taken.begin, self.taken.inputs))
            if not begin == ends == declared or before not in ({}, stored):
                raise InvalidInput(f"the arrays of the last step in the state do not fit unit '{unit}'")

    def to_bytes(self) -> bytes:
        """The snapshot in NumPy's npz format, without pickled objects; an array that it holds twice is there once."""
        buffer = io.BytesIO()
        groups = {"input": self.inputs, "state": self.state}
        if self.taken is not None:
            groups |= {f"taken_{group}": members for group, members in self.taken.groups()}
        arrays: dict[str, FloatArray] = {}
        places: dict[int, str] = {}
        same: dict[str, str] = {}
        for group, members in groups.items():
            for name, value in members.items():
                key = f"{group}/{name}"
                if places.setdefault(id(value), key) == key:
                    arrays[key] = value
                else:
                    same[key] = places[id(value)]
        header = {
            "format": np.array(_FORMAT),
            "unit": np.array(self.unit),
            "mesh": np.array(self.mesh),
            "phase": np.array(self.phase.name),
            # Numbers as many digits as it takes to read the same ones back.
            "parameters": np.array(json.dumps(dict(self.parameters))),
            "same": np.array(json.dumps(same)),
        }
        if self.taken is not None:
            header["taken"] = np.array([self.taken.time, self.taken.step, self.taken.held])
        np.savez(buffer, allow_pickle=False, **header, **arrays)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> "Snapshot":
        """What `to_bytes` made; InvalidInput for other bytes."""
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                arrays = {key: frozen(stored[key]) if "/" in key else stored[key] for key in stored.files}
            if int(arrays.pop("format")) != _FORMAT:
                raise ValueError("written by another version")
            unit, mesh = str(arrays.pop("unit")), str(arrays.pop("mesh"))
            phase = Phase[str(arrays.pop("phase"))]
            parameters, same = (dict(json.loads(str(arrays.pop(key)))) for key in ("parameters", "same"))
            arrays |= {key: arrays[place] for key, place in same.items()}
            times = arrays.pop("taken", None)
            time, step, held = (0.0, 0.0, 1.0) if times is None else times.tolist()
        # NumPy's readers raise whatever the damaged bytes trip them over.
        except Exception as error:
            raise InvalidInput(f"the bytes are not a serialized state of a unit ({error})") from error

        def group(name: str) -> dict[str, FloatArray]:
            return {key.removeprefix(f"{name}/"): value for key, value in arrays.items() if key.startswith(f"{name}/")}

        taken = None
        if times is not None:
            inputs = group("taken_inputs")
            taken = Taken(group("taken_before"), inputs if held else group("taken_begin"), inputs, time, step)
        return cls(unit, mesh, phase, parameters, group("input"), group("state"), taken)


def _shapes(arrays: State) -> dict[str, tuple[int, ...]]:
    return {name: value.shape for name, value in arrays.items()}
