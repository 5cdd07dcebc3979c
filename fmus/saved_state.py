"""What fmi2GetFMUstate and fmi3GetFMUState save: a unit's snapshot and what its instance knows besides."""

import io
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..units.arrays import FloatArray, frozen
from ..units.errors import InvalidInput
from ..units.snapshot import Snapshot
from .clock import Clock

_PREFIX = "derivative/"


@dataclass(frozen=True)
class SavedState:
    """A snapshot, the clock, and the time derivatives of inputs that were set for the next step, in 1/s."""

    snapshot: Snapshot
    clock: Clock
    derivatives: Mapping[str, FloatArray]

    def to_bytes(self) -> bytes:
        """The state in NumPy's npz format, without pickled objects."""
        buffer = io.BytesIO()
        arrays = {f"{_PREFIX}{name}": value for name, value in self.derivatives.items()}
        snapshot = np.frombuffer(self.snapshot.to_bytes(), np.uint8)
        np.savez(buffer, allow_pickle=False, clock=[self.clock.time, self.clock.stop], snapshot=snapshot, **arrays)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> "SavedState":
        """What `to_bytes` made; InvalidInput for other bytes."""
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                time, stop = stored["clock"].tolist()
                snapshot = Snapshot.from_bytes(stored["snapshot"].tobytes())
                names = [key for key in stored.files if key.startswith(_PREFIX)]
                derivatives = {key.removeprefix(_PREFIX): frozen(stored[key]) for key in names}
                return cls(snapshot, Clock(time, stop), derivatives)
        # NumPy's readers raise whatever the damaged bytes trip them over.
        except Exception as error:
            raise InvalidInput(f"these bytes are not a state of an FMU ({error})") from error
