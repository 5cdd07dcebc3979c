"""A unit's state, saved: to go back to it within a process, or as bytes in another one."""

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .arrays import FloatArray, frozen
from .errors import InvalidInput
from .phase import Phase
from .variable import Scalar

State = Mapping[str, FloatArray]

_FORMAT = 3


@dataclass(frozen=True)
class Snapshot:
    """All that a unit needs to go on from a moment. The arrays are never changed in place.

    `mesh` is the fingerprint of the mesh it belongs to; `parameters` are those that differ from what is declared, or
    were given all the same.
    """

    unit: str
    mesh: str
    phase: Phase
    parameters: Mapping[str, Scalar]
    inputs: State
    state: State

    def to_bytes(self) -> bytes:
        """The snapshot in NumPy's npz format, without pickled objects."""
        buffer = io.BytesIO()
        groups = {"input": self.inputs, "state": self.state}
        arrays = {f"{group}/{name}": value for group, members in groups.items() for name, value in members.items()}
        header = {
            "format": np.array(_FORMAT),
            "unit": np.array(self.unit),
            "mesh": np.array(self.mesh),
            "phase": np.array(self.phase.name),
            # Numbers as many digits as it takes to read the same ones back.
            "parameters": np.array(json.dumps(dict(self.parameters))),
        }
        np.savez(buffer, allow_pickle=False, **header, **arrays)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> "Snapshot":
        """What `to_bytes` made; InvalidInput for other bytes."""
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                arrays = {key: stored[key] for key in stored.files}
            if int(arrays.pop("format")) != _FORMAT:
                raise ValueError("written by another version")
            unit, mesh = str(arrays.pop("unit")), str(arrays.pop("mesh"))
            phase, parameters = Phase[str(arrays.pop("phase"))], json.loads(str(arrays.pop("parameters")))
        # NumPy's readers raise whatever the damaged bytes trip them over.
        except Exception as error:
            raise InvalidInput(f"the bytes are no serialized state of a unit ({error})") from error

        def group(prefix: str) -> dict[str, FloatArray]:
            return {key.removeprefix(prefix): frozen(value) for key, value in arrays.items() if key.startswith(prefix)}

        return cls(unit, mesh, phase, parameters, group("input/"), group("state/"))
