"""Steps that missed their tolerance because they could not be any shorter, counted by what is known in the end.

Errors are relative to how far a field moves over the run, which is not known while it begins to move. A step that is
too long by what was known when it was taken may be short enough by what is known later.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

#: Steps that are judged anew; when there are more, what the first few of a run were does not matter.
_MOST = 1000


@dataclass(frozen=True)
class Missed:
    """How many steps missed the tolerance, and where the first of them ended (ms)."""

    steps: int = 0
    first_ms: float | None = None


class MissedTolerance:
    """Takes the steps as they come, and counts those that are still too long by the ranges of the fields."""

    def __init__(self) -> None:
        # By the time at which a step ended, the range of each field from which its error would be small enough.
        self._needed: dict[float, Mapping[str, float]] = {}
        self._further = 0

    def add(self, time_ms: float, needed: Mapping[str, float]) -> None:
        """A step to `time_ms` would have been short enough had each of the fields moved by what is `needed`."""
        if len(self._needed) < _MOST:
            self._needed[time_ms] = dict(needed)
        else:
            self._further += 1

    def counted(self, ranges: Mapping[str, float]) -> Missed:
        """The steps that are too long now that the fields have moved by their `ranges`."""
        still = [
            time
            for time, needed in self._needed.items()
            if any(ranges.get(name, 0.0) < least for name, least in needed.items())
        ]
        return Missed(len(still) + self._further, min(still, default=None))

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        rows = [(time, name, least) for time, needed in self._needed.items() for name, least in needed.items()]
        return {
            "times_ms": np.array([time for time, _, _ in rows]),
            "names": np.array([name.encode() for _, name, _ in rows], dtype=np.bytes_),
            "needed": np.array([least for _, _, least in rows]),
            "further": np.array(self._further),
        }

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        rows: dict[float, dict[str, float]] = {}
        columns = (memory["times_ms"].tolist(), memory["names"].tolist(), memory["needed"].tolist())
        for time, name, least in zip(*columns, strict=True):
            rows.setdefault(time, {})[name.decode()] = least
        self._needed, self._further = dict(rows), int(memory["further"])
