"""How long a run took, and who used the time, over all processes that worked on it."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .coupling.master import MASTER, WAITING
from .stopwatch import Stopwatch


class WallClock:
    """Seconds of a run by unit; `before` is the `memory` of an earlier process that this one goes on from.

    The run was `started`, and `ready` to initialise its units, at these times of the process's clock.
    """

    def __init__(
        self, watch: Stopwatch, units: Sequence[str], started: float, ready: float, before: Mapping[str, Any] | None
    ) -> None:
        self._watch = watch
        self._units = units
        self._ready = ready
        self._setup = ready - started
        self._before = {label: 0.0 if before is None else float(before[label]) for label in self._used()}

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        now = self._now()
        return {label: np.array(seconds) for label, seconds in now.items()}

    def seconds(self) -> dict[str, Any]:
        """`total`, `master`, `units` by name, `setup`. Units that step at the same time add up to more than passes."""
        now = self._now()
        return {
            "total": now["total"],
            MASTER: now["total"] - now[WAITING],
            "units": {unit: now[f"unit {unit}"] for unit in self._units},
            "setup": now["setup"],
        }

    def _now(self) -> dict[str, float]:
        used = self._used()
        return {label: seconds + self._before[label] for label, seconds in used.items()}

    def _used(self) -> dict[str, float]:
        """By this process alone."""
        total = {"total": time.perf_counter() - self._ready, "setup": self._setup, WAITING: self._watch.total[WAITING]}
        total |= {f"unit {unit}": self._watch.total[unit] for unit in self._units}
        return total
