"""A unit's state, saved: to go back to it within a process, or as bytes in another one."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .arrays import FloatArray, frozen
from .errors import InvalidInput

State = Mapping[str, FloatArray]

_FORMAT = 2


@dataclass(frozen=True)
class Snapshot:
    """All that a unit needs to go on from a moment, its parameters apart. The arrays are never changed in place.

    `mesh` is the fingerprint of the mesh it belongs to; `begins` the inputs from which the next step's ramps start,
    where the unit ramps them.
    """

    unit: str
    mesh: str
    inputs: State
    state: State
    begins: State = field(default_factory=dict)

    def to_bytes(self) -> bytes:
        """The snapshot in NumPy's npz format, without pickled objects."""
        buffer = io.BytesIO()
        groups = {"input": self.inputs, "state": self.state, "begin": self.begins}
        arrays = {f"{group}/{name}": value for group, members in groups.items() for name, value in members.items()}
        header = {"format": np.array(_FORMAT), "unit": np.array(self.unit), "mesh": np.array(self.mesh)}
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
        # NumPy's readers raise whatever the damaged bytes trip them over.
        except Exception as error:
            raise InvalidInput(f"the bytes are no serialized state of a unit ({error})") from error

        def group(prefix: str) -> dict[str, FloatArray]:
            return {key.removeprefix(prefix): frozen(value) for key, value in arrays.items() if key.startswith(prefix)}

        return cls(unit, mesh, group("input/"), group("state/"), group("begin/"))
