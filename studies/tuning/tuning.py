"""From a scenario and tolerances to the cheapest setting that keeps them, with what shows that it does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...orchestrator.errors import InputError, RunError
from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.scenario import Scenario, parsed_assignment
from ..bench import Bench
from ..chart import Chart, Row
from ..chart.charted import reference_runs, references_told
from ..chart.compared import Comparison
from ..chart.model import CPU, PRUNED, WALL
from ..plan import Plan, Variants
from ..point import Point, told
from ..trial import REFUSED, Trial
from .options import AS_IT_IS, Option, options_of_scenario, options_of_study, options_on_meshes
from .references import references_of
from .search import Outcome, Search
from .tolerances import chosen_measures

#: Points whose cost is within this part of the best's are timed again in turn, with the scenario as it is: so many of
#: them, to so many runs each.
_NEAR, _FINALISTS, _RUNS = 0.08, 4, 7

#: The part of a tolerance that the reference may err by itself.
_TRUSTED = 1.0 / 3.0


@dataclass(frozen=True)
class Task:
    """A scenario in `file` that is to be tuned, with the settings `common` to all points; `own` has no others."""

    file: Path
    common: Mapping[str, Any]
    scenario: Scenario
    own: Point


@dataclass(frozen=True)
class Tuning:
    """What a search has found, and its evidence.

    `options` and `rows` are all that was considered, in the same order, `own` is the scenario as it is. `best` is the
    place of the cheapest that keeps all tolerances, None if none does; `nearest` that of the smallest worst error over
    tolerance, None if nothing ran. `cost` is what they were compared by, WALL or CPU.
    """

    task: Task
    options: Sequence[Option]
    rows: Sequence[Row]
    own: Row
    chart: Chart
    cost: str
    best: int | None
    nearest: int | None

    @property
    def limits(self) -> Mapping[str, float]:
        """The tolerances, by measure."""
        return self.chart.limits

    def settings(self, place: int) -> dict[str, Any]:
        """All that makes a point differ from the scenario's file."""
        return {**self.task.common, **self.options[place].settings}


def tune_scenario(
    file: Path, limits: Mapping[str, float], bench: Bench, assignments: Sequence[str] = (), with_mesh: bool = False
) -> Tuning:
    """Tune a scenario among ways of coupling, steps and internal accuracy, `with_mesh` among meshes too.

    Raises
    ------
    InputError
        For a measure that the scenario does not have, or that cannot be compared.
    RunError
        If the scenario as it is or the reference fails.
    """
    variants, task = _task(file, dict(parsed_assignment(assignment) for assignment in assignments), str(file))
    if with_mesh and task.scenario.scene is None:
        raise InputError(f"{file}: --mesh: the scenario has no `scene`, so there is no mesh to vary; leave --mesh out")
    measures = chosen_measures(limits, _own(task, bench).run, with_mesh)
    settings = references_of(task.scenario, with_mesh)
    runs = [_reference(variants, each, bench, file) for each in settings]
    comparison = Comparison.with_references(runs, measures, [told(each) for each in settings], limits)
    options = (options_on_meshes if with_mesh else options_of_scenario)(variants, task.scenario, file.parent)
    return _Tuner(bench, comparison, options).tuned(task)


def tune_study(
    plan: Plan, file: Path, limits: Mapping[str, float], bench: Bench, assignments: Sequence[str] = ()
) -> Tuning:
    """Tune a scenario among the points of a study of it, and nothing else; errors are from the study's reference.

    InputError if the study is of another scenario, and as for `tune_scenario`.
    """
    named = Path(plan.origin).parent / plan.study.scenario
    if named.resolve() != file.resolve():
        raise InputError(f"{plan.origin}: scenario: the study is of {named}, not of {file}; give one of the two")
    common = {**plan.study.set, **dict(parsed_assignment(assignment) for assignment in assignments)}
    _, task = _task(file, common, plan.origin)
    measures = chosen_measures(limits, _own(task, bench).run, across_meshes=False)
    comparison = Comparison.with_references(reference_runs(plan, bench), measures, references_told(plan), limits)
    return _Tuner(bench, comparison, options_of_study(plan, task.scenario)).tuned(task)


def _task(file: Path, common: Mapping[str, Any], origin: str) -> tuple[Variants, Task]:
    variants = Variants(file, common, origin)
    own = variants.point({})
    return variants, Task(file, common, own.scenario, own)


def _own(task: Task, bench: Bench) -> Trial:
    (trial,) = bench.run([task.own], AS_IT_IS)
    if not trial.is_done:
        wrong = InputError if trial.status == REFUSED else RunError
        raise wrong(f"{task.file}: {AS_IT_IS}: this run {trial.status}: {trial.reason}")
    return trial


def _reference(variants: Variants, settings: Mapping[str, Any], bench: Bench, file: Path) -> StoredRun:
    (trial,) = bench.run([variants.point(settings, "reference")], "reference")
    if not trial.is_done:
        raise RunError(
            f"{file}: the reference, {told(settings)}, {trial.status}: {trial.reason}; the errors of all points are "
            "taken from it, so give another one in a study (--study)"
        )
    return trial.run


class _Tuner:
    """Runs what the search asks for, and compares it."""

    def __init__(self, bench: Bench, comparison: Comparison, options: Sequence[Option]) -> None:
        self._bench = bench
        self._comparison = comparison
        self._options = options
        self._search = Search([option.candidate for option in options])
        self._rows: dict[int, Row] = {}
        known = [bench.known(option.point) for option in options if option.point is not None]
        alone = bench.is_alone and all(trial.alone for trial in known if trial is not None and trial.is_done)
        self._cost = WALL if alone else CPU

    def tuned(self, task: Task) -> Tuning:
        """Search until nothing is left that can win."""
        for place, option in enumerate(self._options):
            if option.point is None:
                self._tell(place, self._comparison.row(option.shown, None, option.reason))
        timed: set[int] = set()
        while True:
            while places := self._search.next(self._bench.places):
                self._run(places)
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
        notes = _doubts(self._comparison)
        chart = self._comparison.chart(task.scenario.name, str(task.file), _lines(self._options, rows, own), notes)
        return Tuning(task, self._options, rows, own, chart, self._cost, self._search.best, self._search.nearest())

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
        outcome = None
        if row.is_done and row.trial is not None:
            # A machine that is busy with something else adds to the wall clock, and little to the processor's.
            floor = min(min(cost.wall_s, cost.cpu_s) for cost in row.trial.costs)
            outcome = Outcome(row.cost(self._cost), row.worst(self._comparison.limits), floor)
        self._search.tell(place, outcome)

    def _point(self, place: int) -> Point:
        point = self._options[place].point
        if point is None:
            raise ValueError(self._options[place].reason)
        return point


def _lines(options: Sequence[Option], rows: Sequence[Row], own: Row) -> dict[str, list[Row]]:
    lines: dict[str, list[Row]] = {AS_IT_IS: [own]}
    for option, row in zip(options, rows, strict=True):
        lines.setdefault(option.line, []).append(row)
    return lines


def _doubts(comparison: Comparison) -> list[str]:
    """Where the reference is hardly better than what is asked of the points."""
    notes = []
    for name, limit in comparison.limits.items():
        unsure = comparison.uncertainty.get(name)
        if unsure is not None and not unsure <= _TRUSTED * limit:
            notes.append(
                f"the reference errs by {unsure:.3g} itself in {name}, which is more than a third of the tolerance "
                f"{limit:g}: what is near the tolerance may be on either side of it; give a finer one in a study"
            )
    return notes
