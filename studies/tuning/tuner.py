"""Runs what a search asks for, compares it with the reference, and gathers the evidence."""

from collections.abc import Sequence
from statistics import median

from ..bench import Bench
from ..chart import Row
from ..chart.chart import CPU, PRUNED, WALL
from ..chart.compared import Comparison
from ..point import Point
from .options import AS_IT_IS, Option
from .result import Task, Tuning
from .search import Outcome, Search
from .steps import divides

#: Points whose cost is within this part of the best's are timed again in turn, with the scenario as it is: so many of
#: them, to so many runs each.
_NEAR, _FINALISTS, _RUNS = 0.08, 4, 7

#: The line of the best with a longer output interval, and the keys that it changes.
LONGER = "the best, with twice the output interval"
_STEP, _EVERY = "coupling.step_ms", "output.every_ms"

#: Wall clock over processor seconds from which on a machine counts as busy with something else; no time is below that.
_BUSY, _LEAST_S = 1.3, 1e-3
_BUSY_NOTE = "the machine was busy with other programs, so CPU seconds are compared instead of wall-clock seconds"

#: The part of a tolerance that the reference may err by itself.
_TRUSTED = 1.0 / 3.0


class Tuner:
    """Runs what the search asks for, and compares it."""

    def __init__(self, bench: Bench, comparison: Comparison, options: Sequence[Option]) -> None:
        self._bench = bench
        self._comparison = comparison
        self._options = options
        self._search = Search([option.candidate for option in options])
        self._rows: dict[int, Row] = {}
        self._cost = WALL if bench.is_alone else CPU

    def tuned(self, task: Task) -> Tuning:
        """Search until nothing is left that can win."""
        for place, option in enumerate(self._options):
            if option.point is None:
                self._tell(place, self._comparison.row(option.shown, None, option.reason))
        timed, busy = set[int](), False
        while True:
            while places := self._search.next(self._bench.places):
                self._run(places)
            if self._cost == WALL and self._is_busy():
                busy = True
                self._count_processor()
                continue
            finalists = self._search.finalists(_NEAR, _FINALISTS)
            if timed.issuperset(finalists):
                break
            timed.update(finalists)
            self._time_again(finalists, task.own)
            self._search.reconsider()
        for place, reason in self._search.pruned.items():
            self._rows[place] = self._comparison.row(self._options[place].shown, None, reason, PRUNED)
        rows = [self._rows[place] for place in range(len(self._options))]
        own = self._comparison.row({}, self._bench.known(task.own))
        longer = self._longer(task)
        notes = [*_doubts(self._comparison), *([_BUSY_NOTE] if busy else [])]
        lines = _lines(self._options, rows, own, longer)
        chart = self._comparison.chart(task.scenario.name, str(task.file), lines, notes, self._cost)
        best, nearest = self._search.best, self._search.nearest()
        wins = longer is not None and best is not None and self._is_better(longer, rows[best])
        return Tuning(task, self._options, rows, own, chart, self._cost, best, nearest, longer if wins else None)

    def _is_busy(self) -> bool:
        """Whether something else was running, so that the wall clock says little."""
        trials = [row.trial for row in self._rows.values() if row.trial is not None and row.is_done]
        waited = [trial.wall_s / max(trial.cpu_s, _LEAST_S) for trial in trials]
        return bool(waited) and median(waited) > _BUSY

    def _count_processor(self) -> None:
        """Compare seconds of the processor from now on, for the wall clock says little."""
        self._cost = CPU
        for place, row in self._rows.items():
            self._search.tell(place, self._outcome(row))
        self._search.reconsider()

    def _longer(self, task: Task) -> Row | None:
        """The best with twice the output interval, where its steps are as long as that."""
        best = self._search.best
        if task.variants is None or best is None:
            return None
        settings = dict(self._options[best].settings)
        interval = 2.0 * task.scenario.output.every_ms
        if settings.get(_STEP) != task.scenario.output.every_ms or not divides(interval, task.scenario.run.stop_ms):
            return None
        shown = {**self._options[best].shown, _STEP: interval, _EVERY: interval}
        (trial,) = self._bench.run([task.variants.point({**settings, _STEP: interval, _EVERY: interval})], LONGER)
        return self._comparison.row(shown, trial)

    def _is_better(self, row: Row, best: Row) -> bool:
        kept = row.worst(self._comparison.limits) <= 1.0
        return kept and row.cost(self._cost) < best.cost(self._cost)

    def _run(self, places: Sequence[int]) -> None:
        trials = self._bench.run([self._point(place) for place in places], "tuning")
        for place, trial in zip(places, trials, strict=True):
            self._tell(place, self._comparison.row(self._options[place].shown, trial))

    def _time_again(self, places: Sequence[int], own: Point) -> None:
        """Decide between those that cost nearly the same, and tell what they save, by more runs of them in turn."""
        trials = self._bench.time_in_turn(
            [own, *(self._point(place) for place in places)], _RUNS, "timing the best again"
        )
        for place, trial in zip(places, trials[1:], strict=True):
            self._tell(place, self._comparison.row(self._options[place].shown, trial))

    def _tell(self, place: int, row: Row) -> None:
        self._rows[place] = row
        if self._cost == WALL and row.trial is not None and not row.trial.alone:
            # It was run before, beside others: only the processor's seconds can be compared with its own.
            self._count_processor()
        self._search.tell(place, self._outcome(row))

    def _outcome(self, row: Row) -> Outcome | None:
        if row.trial is None or not row.is_done:
            return None
        # Whatever else a machine does adds to the wall clock, and less to the processor's.
        floor = min(min(cost.wall_s, cost.cpu_s) if self._cost == WALL else cost.cpu_s for cost in row.trial.costs)
        return Outcome(row.cost(self._cost), row.worst(self._comparison.limits), floor)

    def _point(self, place: int) -> Point:
        point = self._options[place].point
        if point is None:
            raise ValueError(self._options[place].reason)
        return point


def _lines(options: Sequence[Option], rows: Sequence[Row], own: Row, longer: Row | None) -> dict[str, list[Row]]:
    lines: dict[str, list[Row]] = {AS_IT_IS: [own]}
    for option, row in zip(options, rows, strict=True):
        lines.setdefault(option.line, []).append(row)
    if longer is not None:
        lines[LONGER] = [longer]
    return lines


def _doubts(comparison: Comparison) -> list[str]:
    """Where the reference is hardly better than what is asked of the points."""
    notes = []
    for name, limit in comparison.limits.items():
        unsure = comparison.uncertainty.get(name)
        if unsure is not None and not unsure <= _TRUSTED * limit:
            notes.append(
                f"the uncertainty of the reference in {name} is {unsure:.3g}, more than a third of the tolerance "
                f"{limit:g}: a point near the tolerance may be on either side of it; give a finer reference in a study"
            )
    return notes
