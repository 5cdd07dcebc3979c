"""From a plan to a chart: references and points run, compared and ranked."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite, isnan, nan
from typing import Any

from ...orchestrator.errors import InputError, did_you_mean
from ...orchestrator.results.comparison import Measure, measures
from ...orchestrator.results.stored_run import StoredRun
from ..bench import Bench
from ..machine import machine
from ..order import observed_order, step_of
from ..plan import Plan, Planned, Reference
from ..trial import REFUSED
from .front import on_front
from .model import CPU, WALL, Chart, ChartLine, Row


def chart_study(plan: Plan, bench: Bench) -> Chart:
    """Run what is missing of a study, and chart it.

    InputError where a reference fails, and for a measure that the scenario does not have.
    """
    references = [_results(reference, plan, bench) for reference in plan.references]
    chosen = _chosen(plan, references[0])
    uncertainty = {}
    if len(references) > 1:
        uncertainty = {measure.name: measure.between(references[1], references[0]).value for measure in chosen}
    trials = iter(bench.run(plan.points, plan.study.name))
    lines = {
        name: [_row(planned, next(trials) if planned.point else None, chosen, references[0]) for planned in line]
        for name, line in plan.lines.items()
    }
    rows = [row for line in lines.values() for row in line]
    if not any(row.is_done for row in rows):
        raise InputError(f"{plan.origin}: no point came to its end, the first because of: {rows[0].reason}")
    compared = [measure for measure in chosen if any(measure.name in row.errors for row in rows)]
    alone = all(row.trial.alone for row in rows if row.trial is not None and row.is_done)
    cost = WALL if alone else CPU
    lines = _ranked(lines, cost, compared)
    versions = references[0].summary.get("versions", {})
    return Chart(
        plan.study.name,
        plan.study.scenario,
        cost,
        compared,
        [ChartLine(name, line, _orders(line, compared, uncertainty)) for name, line in lines.items()],
        [reference.origin.removeprefix("reference: ") for reference in plan.references],
        {name: value for name, value in uncertainty.items() if not isnan(value)},
        machine(),
        versions,
        _notes(chosen, compared, rows, alone),
    )


def _results(reference: Reference, plan: Plan, bench: Bench) -> StoredRun:
    if reference.point is not None:
        (trial,) = bench.run([reference.point], reference.origin)
        if not trial.is_done:
            raise InputError(
                f"{plan.origin}: {reference.origin}: this run {trial.status}: {trial.reason}; the errors of all points "
                "are taken from it, so change `reference`"
            )
        return trial.run
    run = StoredRun(reference.folder or "")
    if run.summary.get("status") != "done" or not run.columns:
        raise InputError(
            f"{plan.origin}: {reference.origin}: there are no results of a run that is done; give the folder that "
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


def _row(planned: Planned, trial: Any, chosen: Sequence[Measure], reference: StoredRun) -> Row:
    if trial is None:
        return Row(planned.settings, REFUSED, planned.reason, None)
    if not trial.is_done:
        return Row(planned.settings, trial.status, trial.reason, trial)
    found = {measure.name: measure.between(trial.run, reference) for measure in chosen}
    errors = {name: difference.value for name, difference in found.items() if not isnan(difference.value)}
    why = dict.fromkeys(difference.why for difference in found.values() if difference.why)
    return Row(planned.settings, trial.status, "; ".join(why), trial, errors)


def _ranked(lines: Mapping[str, Sequence[Row]], cost: str, compared: Sequence[Measure]) -> dict[str, list[Row]]:
    """The same with the fronts of all points that are done."""
    done = [row for line in lines.values() for row in line if row.is_done]
    costs = [row.cost(cost) for row in done]
    fronts: dict[int, set[str]] = {id(row): set() for row in done}
    for measure in compared:
        on = on_front(costs, [row.errors.get(measure.name, nan) for row in done])
        for row, is_on in zip(done, on, strict=True):
            if is_on:
                fronts[id(row)].add(measure.name)
    return {
        name: [replace(row, front=frozenset(fronts[id(row)])) if row.is_done else row for row in line]
        for name, line in lines.items()
    }


def _orders(rows: Sequence[Row], compared: Sequence[Measure], uncertainty: Mapping[str, float]) -> dict[str, float]:
    done = [row for row in rows if row.is_done]
    steps = [step_of(row.settings) for row in done]
    found = {}
    for measure in compared:
        errors = [row.errors.get(measure.name, nan) for row in done]
        order = observed_order(steps, errors, uncertainty.get(measure.name, 0.0))
        if order is not None:
            found[measure.name] = order
    return found


def _notes(chosen: Sequence[Measure], compared: Sequence[Measure], rows: Sequence[Row], alone: bool) -> list[str]:
    notes = []
    left_out = [measure.name for measure in chosen if measure not in compared]
    if left_out:
        notes.append(f"not compared, for no point has the reference's mesh: {', '.join(left_out)}")
    if not alone:
        notes.append("points ran beside others, so that processor seconds are compared")
    missing = sum(not row.is_done for row in rows)
    if missing:
        notes.append(f"{missing} of {len(rows)} points have no results")
    never = sum(any(not isfinite(error) for error in row.errors.values()) for row in rows)
    if never:
        notes.append(f"{never} points lack what the reference has, or have what it lacks: their error is infinite")
    return notes
