"""How it went with a point: its results, or why there are none, and what it cost."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from statistics import median

from ..orchestrator.results.stored_run import StoredRun
from ..orchestrator.results.whole import write_whole

#: The file in a point's folder that says that the point is finished, in whatever way.
_FILE = "trial.json"

DONE, FAILED, REFUSED, CRASHED = "done", "failed", "refused", "crashed"

#: How the reason of a run begins that an error in this program ended.
BUG = "a bug"


@dataclass(frozen=True)
class Cost:
    """What one run of a point took: seconds of wall clock and processor from its initialisation to its end."""

    wall_s: float
    cpu_s: float
    cpu_s_units: Mapping[str, float]


@dataclass(frozen=True)
class Trial:
    """`status` is `done`, `failed` (by physics or coupling), `refused` (its input is wrong) or `crashed`.

    `reason` says why it is not done. `costs` are those of the runs of a point: one, or several of a short one. Where it
    was not `alone` on its cores its wall clock says little.
    """

    folder: Path
    status: str
    reason: str = ""
    costs: tuple[Cost, ...] = ()
    solves: Mapping[str, int] = field(default_factory=dict)
    sweeps: int = 0
    alone: bool = True

    @cached_property
    def run(self) -> StoredRun:
        """Its results."""
        return StoredRun(self.folder)

    @property
    def is_done(self) -> bool:
        """Whether there are results to the end."""
        return self.status == DONE

    @property
    def wall_s(self) -> float:
        """Median of the runs."""
        return median(cost.wall_s for cost in self.costs)

    @property
    def wall_spread_s(self) -> float:
        """Between the longest and the shortest run."""
        walls = [cost.wall_s for cost in self.costs]
        return max(walls) - min(walls)

    @property
    def cpu_s(self) -> float:
        """Median of the runs."""
        return median(cost.cpu_s for cost in self.costs)

    def unit_cpu_s(self, unit: str) -> float:
        """Median of the runs, of one unit."""
        return median(cost.cpu_s_units[unit] for cost in self.costs)

    def write(self) -> None:
        """Say in the point's folder that it is finished."""
        content = {name: value for name, value in asdict(self).items() if name != "folder"}
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self.folder / _FILE, f"{json.dumps(content, indent=1)}\n".encode())


def read_trial(folder: Path) -> Trial | None:
    """How it went with the point in `folder`; None if it is not finished, or was cut off and is to be tried again."""
    try:
        content = json.loads((folder / _FILE).read_text(encoding="utf-8"))
        if content["status"] == CRASHED or set(content) != {each.name for each in fields(Trial)} - {"folder"}:
            return None
        costs = tuple(Cost(**cost) for cost in content.pop("costs"))
        return Trial(folder, costs=costs, **content)
    except (OSError, ValueError, KeyError, TypeError):
        return None
