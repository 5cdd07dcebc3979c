"""What a search for the cheapest setting was asked for, and what it has found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...orchestrator.scenario import Scenario
from ..chart import Chart, Row
from ..plan import Variants
from ..point import Point
from .options import Option


@dataclass(frozen=True)
class Task:
    """A scenario in `file` that is to be tuned, with the settings `common` to all points; `own` has no others.

    `variants` make points of it; None where a study says which there are.
    """

    file: Path
    common: Mapping[str, Any]
    scenario: Scenario
    own: Point
    variants: Variants | None


@dataclass(frozen=True)
class Tuning:
    """What a search has found, and its evidence.

    `options` and `rows` are all that was considered, in the same order, `own` is the scenario as it is. `best` is the
    place of the cheapest that keeps all tolerances, None if none does; `nearest` that of the smallest worst error over
    tolerance, None if nothing ran. `cost` is what they were compared by, WALL or CPU. `longer` is the best with twice
    the output interval and steps as long, where that keeps the tolerances and costs less: it changes what is kept.
    """

    task: Task
    options: Sequence[Option]
    rows: Sequence[Row]
    own: Row
    chart: Chart
    cost: str
    best: int | None
    nearest: int | None
    longer: Row | None

    @property
    def limits(self) -> Mapping[str, float]:
        """The tolerances, by measure."""
        return self.chart.limits

    def settings(self, place: int) -> dict[str, Any]:
        """All that makes a point differ from the scenario's file."""
        return {**self.task.common, **self.options[place].settings}
