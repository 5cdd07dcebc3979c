"""From a plan to a chart: references and points run, compared and ranked."""

from ...orchestrator.errors import InputError, did_you_mean
from ...orchestrator.results.comparison import Measure, measures
from ...orchestrator.results.stored_run import StoredRun
from ..bench import Bench
from ..plan import Plan, Reference
from .chart import Chart
from .compared import Comparison


def chart_study(plan: Plan, bench: Bench) -> Chart:
    """Run what is missing of a study, and chart it.

    InputError where a reference fails, and for a measure that the scenario does not have.
    """
    references = reference_runs(plan, bench)
    comparison = Comparison.with_references(references, _chosen(plan, references[0]), references_told(plan))
    trials = iter(bench.run(plan.points, plan.study.name))
    lines = {
        name: [
            comparison.row(planned.settings, next(trials) if planned.point else None, planned.reason)
            for planned in line
        ]
        for name, line in plan.lines.items()
    }
    rows = [row for line in lines.values() for row in line]
    if not any(row.is_done for row in rows):
        raise InputError(
            f"{plan.origin}: no point was run to its end; the first one failed because of: {rows[0].reason}"
        )
    return comparison.chart(plan.study.name, plan.study.scenario, lines)


def reference_runs(plan: Plan, bench: Bench) -> list[StoredRun]:
    """The results of a study's references, run where that is missing; InputError where one has none."""
    return [_results(reference, plan, bench) for reference in plan.references]


def references_told(plan: Plan) -> list[str]:
    """What a study's references are, in words."""
    return [reference.origin.removeprefix("reference: ") for reference in plan.references]


def _results(reference: Reference, plan: Plan, bench: Bench) -> StoredRun:
    if reference.point is not None:
        (trial,) = bench.run([reference.point], reference.origin)
        if not trial.is_done:
            raise InputError(
                f"{plan.origin}: {reference.origin}: this run {trial.status}: {trial.reason}; the errors of all points "
                "are taken from it, so change `reference`"
            )
        return trial.run
    return stored_results(reference, plan.origin)


def stored_results(reference: Reference, origin: str) -> StoredRun:
    """The results of a reference that are there; InputError, with the `origin` in front, where they are not."""
    run = StoredRun(reference.folder or "")
    if run.summary.get("status") != "done" or not run.columns:
        raise InputError(
            f"{origin}: {reference.origin}: there are no results of a run that is done; give the folder that "
            "`cosim run` wrote, relative to the study's file"
        )
    return run


def _chosen(plan: Plan, reference: StoredRun) -> list[Measure]:
    known = measures(reference)
    for name in plan.study.measures or ():
        if name not in known:
            raise InputError(
                f"{plan.origin}: measures: the scenario has no '{name}', or it never changes"
                f"{did_you_mean(name, known)}; name a quantity that the scenario records and that moves"
            )
    if not known:
        raise InputError(f"{plan.origin}: the scenario records nothing to measure; see `output` in the scenario")
    return [known[name] for name in dict.fromkeys(plan.study.measures or known)]
