"""A panel of a chart: where the points stand for one measure and one view of their cost."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import inf, isfinite, isnan, log10, nan

from ...orchestrator.results.comparison import Measure
from .chart import CPU, WALL, Chart, ChartLine, Row
from .front import on_front

#: The view over the number of solves, beside the kinds of cost WALL and CPU.
SOLVES = "solves"

_LABELS = {
    WALL: "seconds of wall clock, alone on its core",
    CPU: "seconds of CPU time",
    SOLVES: "solves (steps of all units together)",
}

#: Repeated runs that differ by less than this part of their median need no bar.
_SPREAD = 0.05

#: An axis reaches over this many decades at least, and beyond its points by this part of what it spans.
_DECADES, _MARGIN = 0.9, 0.09

#: Powers of ten that a number can have.
_MOST = 307.0

#: So many decades an axis is made longer at most to show the uncertainty of the reference.
_STRETCH = 1.5


@dataclass(frozen=True)
class View:
    """What points are drawn over: `kind` is WALL, CPU or SOLVES."""

    kind: str

    @property
    def label(self) -> str:
        """For the axis."""
        return _LABELS[self.kind]

    def cost(self, row: Row) -> float:
        """Of a point; NaN where there are no results."""
        if not row.is_done:
            return nan
        return float(row.solves) if self.kind == SOLVES else row.cost(self.kind)

    def extent(self, row: Row) -> tuple[float, float] | None:
        """The least and the most of the repeated runs of a point; None where they agree, or cannot differ."""
        if self.kind == SOLVES or row.trial is None or not row.is_done:
            return None
        costs = [each.wall_s if self.kind == WALL else each.cpu_s for each in row.trial.costs]
        low, high = min(costs), max(costs)
        return (low, high) if high - low > _SPREAD * row.cost(self.kind) else None


@dataclass(frozen=True)
class Spot:
    """A point in a panel: its cost and its error, NaN where it has none, and whether it is on the panel's front."""

    row: Row
    cost: float
    error: float
    is_on_front: bool = False

    @property
    def is_placed(self) -> bool:
        """Whether it has a place of its own on logarithmic axes; the others stand at an edge."""
        return isfinite(self.cost) and isfinite(self.error) and self.error > 0.0


@dataclass(frozen=True)
class Panel:
    """One measure over one view; `spots` are those of each line, in the order of the study.

    `costs` and `errors` are the limits of the axes. `has_scale` is false where no error is a positive number, so that
    the axis of errors has nothing to tell. `uncertainty` of the reference is None where it is not known, and so is the
    `limit` on the error, where there is none.
    """

    measure: Measure
    view: View
    spots: Sequence[Sequence[Spot]]
    costs: tuple[float, float]
    errors: tuple[float, float]
    has_scale: bool
    uncertainty: float | None
    limit: float | None = None

    @property
    def front(self) -> list[Spot]:
        """The points on the front, the cheapest first."""
        return sorted((spot for line in self.spots for spot in line if spot.is_on_front), key=lambda spot: spot.cost)

    def place(self, spot: Spot) -> tuple[float, float]:
        """Where a point with results stands: at an edge where its error is infinite, unknown or zero."""
        error = inf if isnan(spot.error) else spot.error
        return self._within(spot.cost, self.costs), self._within(error, self.errors)

    def stairs(self) -> tuple[list[float], list[float]]:
        """The front's corners: what error can be had for at most so much, from its cheapest point to the right edge."""
        places = [self.place(spot) for spot in self.front]
        across, up = [], []
        for number, (cost, error) in enumerate(places):
            if number:
                across.append(cost)
                up.append(places[number - 1][1])
            across.append(cost)
            up.append(error)
        if places:
            across.append(self.costs[1])
            up.append(places[-1][1])
        return across, up

    @staticmethod
    def _within(value: float, limits: tuple[float, float]) -> float:
        return min(max(value, limits[0]), limits[1])


def views(chart: Chart) -> tuple[View, View]:
    """The two views of a chart: over seconds and over solves."""
    return View(chart.cost), View(SOLVES)


def panel(chart: Chart, measure: Measure, view: View) -> Panel:
    """The panel of a chart for this measure and view; its front is that of the view's own cost."""
    rows = [(number, row) for number, line in enumerate(chart.lines) for row in line.rows]
    costs = [view.cost(row) for _, row in rows]
    errors = [row.errors.get(measure.name, nan) if row.is_done else nan for _, row in rows]
    fronts = [measure.name in row.front for _, row in rows] if view.kind == chart.cost else on_front(costs, errors)
    spots: list[list[Spot]] = [[] for _ in chart.lines]
    for (number, row), cost, error, is_on in zip(rows, costs, errors, fronts, strict=True):
        spots[number].append(Spot(row, cost, error, is_on))
    known = [error for error in errors if isfinite(error) and error > 0.0]
    uncertainty = chart.uncertainty.get(measure.name)
    limit = chart.limits.get(measure.name)
    heights = known + _worth_showing(uncertainty, known) + _worth_showing(limit, known)
    widths = [each for _, row in rows for each in view.extent(row) or ()] + costs
    return Panel(measure, view, spots, _limits(widths), _limits(heights), bool(heights), uncertainty, limit)


def is_sweep(line: ChartLine) -> bool:
    """Whether one number varies along a line, so that it is drawn from point to point in the order of that number."""
    return len(line.varied) == 1 and all(
        isinstance(value, int | float) and not isinstance(value, bool)
        for row in line.rows
        for value in row.settings.values()
    )


def path(line: ChartLine, spots: Sequence[Spot]) -> list[list[Spot]]:
    """Which points of a line are to be connected: pieces between points that have no place.

    Where several keys vary, or names, the order of the points means nothing: those on the line's own front are
    connected, which is the best that it can do.
    """
    if is_sweep(line):
        (key,) = line.varied
        ordered = sorted(spots, key=lambda spot: float(spot.row.settings[key]))
        return [list(piece) for placed, piece in groupby(ordered, key=lambda spot: spot.is_placed) if placed]
    placed = [spot for spot in spots if spot.is_placed]
    own = on_front([spot.cost for spot in placed], [spot.error for spot in placed])
    best = [spot for spot, is_on in zip(placed, own, strict=True) if is_on]
    return [sorted(best, key=lambda spot: spot.cost)] if best else []


def _worth_showing(level: float | None, errors: Sequence[float]) -> list[float]:
    if level is None or not 0.0 < level < inf:
        return []
    if errors and not min(errors) / 10.0**_STRETCH < level < max(errors) * 10.0**_STRETCH:
        return []
    return [level]


def _limits(values: Sequence[float]) -> tuple[float, float]:
    """Of a logarithmic axis with room for all `values` that are positive numbers."""
    places = [log10(value) for value in values if isfinite(value) and value > 0.0]
    low, high = (min(places), max(places)) if places else (-1.0, 1.0)
    room = max(_MARGIN * (high - low), 0.5 * (_DECADES - (high - low)), 0.08)
    return 10.0 ** max(low - room, -_MOST), 10.0 ** min(high + room, _MOST)
