"""From a scenario and tolerances to the cheapest setting that keeps them, with what shows that it does."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...orchestrator.errors import InputError, RunError
from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.scenario import parsed_assignments
from ..bench import Bench
from ..chart.charted import reference_runs, references_told
from ..chart.compared import Comparison
from ..plan import Plan, Variants
from ..point import told
from ..trial import REFUSED, Trial
from .options import AS_IT_IS, options_of_scenario, options_of_study, options_on_meshes
from .references import references_of
from .result import Task, Tuning
from .tolerances import chosen_measures
from .tuner import Tuner


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
    common = parsed_assignments(assignments)
    variants = Variants(file, common, str(file))
    own = variants.point({})
    task = Task(file, common, own.scenario, own, variants)
    if with_mesh and task.scenario.scene is None:
        raise InputError(f"{file}: --mesh: the scenario has no `scene`, so there is no mesh to vary; leave --mesh out")
    measures = chosen_measures(limits, _own(task, bench).run, with_mesh)
    settings = references_of(task.scenario, with_mesh)
    runs = [_reference(variants, each, bench, file) for each in settings]
    comparison = Comparison.with_references(runs, measures, [told(each) for each in settings], limits)
    options = (options_on_meshes if with_mesh else options_of_scenario)(variants, task.scenario, file.parent)
    return Tuner(bench, comparison, options).tuned(task)


def tune_study(
    plan: Plan, file: Path, limits: Mapping[str, float], bench: Bench, assignments: Sequence[str] = ()
) -> Tuning:
    """Tune a scenario among the points of a study of it, and nothing else; errors are from the study's reference.

    InputError if the study is of another scenario, and as for `tune_scenario`.
    """
    named = Path(plan.origin).parent / plan.study.scenario
    if named.resolve() != file.resolve():
        raise InputError(f"{plan.origin}: scenario: the study is of {named}, not of {file}; give one of the two")
    common = plan.study.set | parsed_assignments(assignments)
    own = Variants(named, common, plan.origin).point({})
    task = Task(file, common, own.scenario, own, None)
    measures = chosen_measures(limits, _own(task, bench).run, across_meshes=False)
    comparison = Comparison.with_references(reference_runs(plan, bench), measures, references_told(plan), limits)
    return Tuner(bench, comparison, options_of_study(plan, task.scenario)).tuned(task)


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
