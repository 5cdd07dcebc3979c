"""What a run cost: seconds, and how often its units were asked to step, over all processes that worked on it."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .coupling.master import MASTER, WAITING, Master


class Costs:
    """What a run of `master` costs by unit; `before` is the `memory` of an earlier process that this one goes on from.

    The run was `started`, and `ready` to initialise its units, at these times of the process's clock; CPU time counts
    from the making of this object on. `units` are all of them, those that do not step included.
    """

    def __init__(
        self, master: Master, units: Sequence[str], started: float, ready: float, before: Mapping[str, Any] | None
    ) -> None:
        self._master = master
        self._units = units
        self._ready = ready
        self._cpu_ready = time.process_time()
        self._setup = ready - started
        self._before = {label: 0.0 if before is None else float(before[label]) for label in self._used()}

    def memory(self) -> dict[str, Any]:
        """For a checkpoint; what was counted is in the master's memory."""
        now = self._now()
        return {label: np.array(seconds) for label, seconds in now.items()}

    def content(self) -> dict[str, Any]:
        """For the summary: `wall_s`, `cpu_s`, `solves` by unit, and `sweeps`.

        `wall_s` has `total`, `master`, `units` by name, and `setup`; units that step at the same time add up to more
        than passes. `cpu_s` has `total`, of this process and of units in others, and `units` by name.
        """
        now = self._now()
        return {
            "wall_s": {
                "total": now["total"],
                MASTER: now["total"] - now[WAITING],
                "units": {unit: now[f"unit {unit}"] for unit in self._units},
                "setup": now["setup"],
            },
            "cpu_s": {
                "total": now["cpu"],
                "units": {unit: now[f"cpu of unit {unit}"] for unit in self._units},
            },
            "solves": {unit: self._master.solves[unit] for unit in self._units},
            "sweeps": self._master.sweeps,
        }

    def _now(self) -> dict[str, float]:
        used = self._used()
        return {label: seconds + self._before[label] for label, seconds in used.items()}

    def _used(self) -> dict[str, float]:
        """By this process, and the workers of this one, alone."""
        watch = self._master.watch
        used = {"total": time.perf_counter() - self._ready, "setup": self._setup, WAITING: watch.total[WAITING]}
        used["cpu"] = time.process_time() - self._cpu_ready + watch.cpu_apart
        used |= {f"unit {unit}": watch.total[unit] for unit in self._units}
        return used | {f"cpu of unit {unit}": watch.cpu[unit] for unit in self._units}
