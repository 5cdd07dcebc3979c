"""Points compared with a reference: their errors, fronts and orders, for a chart and for a search among them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, isnan, nan
from typing import Any

from ...orchestrator.results.comparison import Measure
from ...orchestrator.results.stored_run import StoredRun
from ..machine import machine
from ..order import observed_order, step_of
from ..trial import REFUSED, Trial
from .chart import CPU, PRUNED, WALL, Chart, ChartLine, Row
from .front import on_front


@dataclass(frozen=True)
class Comparison:
    """What points are compared with: the results `reference`, by the `measures`.

    `uncertainty` is by how much the reference itself may err, by measure, where that is known; `told` says in words
    what the references are. `limits` are the errors that are allowed, where any are.
    """

    reference: StoredRun
    measures: Sequence[Measure]
    uncertainty: Mapping[str, float]
    told: Sequence[str]
    limits: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def with_references(
        cls,
        references: Sequence[StoredRun],
        measures: Sequence[Measure],
        told: Sequence[str],
        limits: Mapping[str, float] | None = None,
    ) -> "Comparison":
        """Compared with the first of one or two `references`, whose difference is the uncertainty."""
        uncertainty = {}
        if len(references) > 1:
            found = {measure.name: measure.between(references[1], references[0]).value for measure in measures}
            uncertainty = {name: value for name, value in found.items() if not isnan(value)}
        return cls(references[0], measures, uncertainty, told, limits or {})

    def row(self, settings: Mapping[str, Any], trial: Trial | None, reason: str = "", status: str = REFUSED) -> Row:
        """A point with its errors; `status` and `reason` are for one without a `trial`."""
        if trial is None:
            return Row(settings, status, reason, None)
        if not trial.is_done:
            return Row(settings, trial.status, trial.reason, trial)
        found = {measure.name: measure.between(trial.run, self.reference) for measure in self.measures}
        errors = {name: difference.value for name, difference in found.items() if not isnan(difference.value)}
        why = dict.fromkeys(difference.why for difference in found.values() if difference.why)
        return Row(settings, trial.status, "; ".join(why), trial, errors)

    def chart(
        self,
        name: str,
        scenario: str,
        lines: Mapping[str, Sequence[Row]],
        notes: Sequence[str] = (),
        cost: str | None = None,
    ) -> Chart:
        """The chart of `lines`, with fronts and orders; `notes` come before those that follow from the points.

        `cost` is WALL or CPU; if it is not given, WALL where all points ran alone.
        """
        rows = [row for line in lines.values() for row in line]
        compared = [measure for measure in self.measures if any(measure.name in row.errors for row in rows)]
        alone = all(row.trial.alone for row in rows if row.trial is not None and row.is_done)
        cost = cost or (WALL if alone else CPU)
        ranked = _ranked(lines, cost, compared)
        return Chart(
            name,
            scenario,
            cost,
            compared,
            [ChartLine(name, line, self._orders(line, compared)) for name, line in ranked.items()],
            self.told,
            self.uncertainty,
            machine(),
            self.reference.summary.get("versions", {}),
            [*notes, *_notes(self.measures, compared, rows, alone)],
            self.limits,
        )

    def _orders(self, rows: Sequence[Row], compared: Sequence[Measure]) -> dict[str, float]:
        done = [row for row in rows if row.is_done]
        steps = [step_of(row.settings) for row in done]
        found = {}
        for measure in compared:
            errors = [row.errors.get(measure.name, nan) for row in done]
            order = observed_order(steps, errors, self.uncertainty.get(measure.name, 0.0))
            if order is not None:
                found[measure.name] = order
        return found


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


def _notes(chosen: Sequence[Measure], compared: Sequence[Measure], rows: Sequence[Row], alone: bool) -> list[str]:
    notes = []
    left_out = [measure.name for measure in chosen if measure not in compared]
    if left_out:
        notes.append(f"not compared, because no point has the mesh of the reference: {', '.join(left_out)}")
    if not alone:
        notes.append("several points ran at the same time, so CPU seconds are compared")
    tried = [row for row in rows if row.status != PRUNED]
    missing = sum(not row.is_done for row in tried)
    if missing:
        notes.append(f"{missing} of {len(tried)} points have no results")
    never = sum(any(not isfinite(error) for error in row.errors.values()) for row in rows)
    if never:
        notes.append(
            f"infinite error: {never} of {len(tried)} points lack a quantity that the reference has, or have one that "
            "it lacks"
        )
    return notes
