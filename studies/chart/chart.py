"""A chart: lines of points, each with its errors, its cost and whether it lies on the front."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

from ...orchestrator.results.comparison import Measure
from ..point import told
from ..trial import Trial

#: What a point costs: seconds of the wall clock where it ran alone, else of the processor.
WALL, CPU = "wall_s", "cpu_s"

#: The status of a point that was considered and not run, because it could not win.
PRUNED = "pruned"


@dataclass(frozen=True)
class Row:
    """A point: its varied `settings`, how it went, its errors by measure, and the measures on whose front it lies.

    `errors` are infinite where only one of point and reference has the quantity, and lack what cannot be compared;
    both have a `reason`. `trial` is None where the settings cannot stand together (`status` refused), and where the
    point was not run (pruned).
    """

    settings: Mapping[str, Any]
    status: str
    reason: str
    trial: Trial | None
    errors: Mapping[str, float] = field(default_factory=dict)
    front: frozenset[str] = frozenset()

    @property
    def is_done(self) -> bool:
        """Whether it has results."""
        return self.trial is not None and self.trial.is_done

    @property
    def solves(self) -> int:
        """Steps of all units together."""
        return 0 if self.trial is None else sum(self.trial.solves.values())

    def value(self, key: str) -> Any:
        """What the point's scenario has at `key`, set or not; None where it has nothing there."""
        found: Any = {} if self.trial is None else self.trial.run.summary.get("scenario")
        for part in key.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
        return found

    def worst(self, limits: Mapping[str, float]) -> float:
        """The largest error over its limit: at most 1 where all `limits` are kept; infinite where one is not known."""
        if not self.is_done:
            return inf
        return max((self.errors.get(name, inf) / limit for name, limit in limits.items()), default=0.0)

    def cost(self, kind: str) -> float:
        """Seconds of the `kind` WALL or CPU; of points that are done."""
        if self.trial is None:
            raise ValueError("a point that was not run has no cost")
        return self.trial.wall_s if kind == WALL else self.trial.cpu_s


@dataclass(frozen=True)
class ChartLine:
    """The points of a line in the order of the study, and the order of accuracy observed for each measure.

    The order is that of the error in the one varied key that is a number (`refine`: in the mesh size that it halves);
    measures for which it cannot be told are left out.
    """

    name: str
    rows: Sequence[Row]
    orders: Mapping[str, float]

    @property
    def varied(self) -> list[str]:
        """The keys that change from point to point."""
        return list(dict.fromkeys(key for row in self.rows for key in row.settings))


@dataclass(frozen=True)
class Chart:
    """A whole chart.

    `cost` is what points are compared by, WALL or CPU. `uncertainty` of the reference is known by measure where there
    are two. `references` say what the points are compared with; `notes` are sentences for a person. `limits` are the
    errors that are allowed, by measure, where any are.
    """

    name: str
    scenario: str
    cost: str
    measures: Sequence[Measure]
    lines: Sequence[ChartLine]
    references: Sequence[str]
    uncertainty: Mapping[str, float]
    machine: Mapping[str, Any]
    versions: Mapping[str, str]
    notes: Sequence[str] = ()
    limits: Mapping[str, float] = field(default_factory=dict)

    @property
    def tried(self) -> "Chart":
        """The same without the points that were considered and not run: what there is to be drawn."""
        lines = [replace(line, rows=[row for row in line.rows if row.status != PRUNED]) for line in self.lines]
        return replace(self, lines=[line for line in lines if line.rows])

    @property
    def rows(self) -> list[Row]:
        """All points."""
        return [row for line in self.lines for row in line.rows]

    @property
    def varied(self) -> list[str]:
        """The keys that change within any of the lines."""
        return list(dict.fromkeys(key for line in self.lines for key in line.varied))

    @property
    def units(self) -> list[str]:
        """The units of all points that are done."""
        trials = [row.trial for row in self.rows if row.trial is not None and row.is_done]
        return list(dict.fromkeys(unit for trial in trials for unit in trial.solves))

    def summary(self) -> str:
        """For a terminal: of each measure the cheapest points of its front first."""
        lines = [f"{self.name}: {sum(row.is_done for row in self.rows)} of {len(self.rows)} points are done"]
        for measure in self.measures:
            on = [(line, row) for line in self.lines for row in line.rows if measure.name in row.front]
            lines.append(f"  front of {measure.name}:")
            for line, row in sorted(on, key=lambda pair: pair[1].cost(self.cost)):
                error = f"{row.errors[measure.name]:.3g} {measure.unit}".rstrip()
                lines.append(f"    {row.cost(self.cost):8.2f} s  {error:>12}  {line.name}, {told(row.settings)}")
        return "\n".join(lines)
