"""From a plan to a stability map: references and cells run, classified, refined at the boundary, and predicted."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

from threadpoolctl import threadpool_limits

from ...orchestrator.errors import InputError
from ..bench import Bench
from ..machine import machine
from ..trial import BUG, Trial
from .accuracy import Accuracy
from .axis import Axis
from .boundary import Bracket, brackets, middle
from .classify import classified
from .limit import Limit, nearest
from .map import NOT_RUN, Cell, Crossing, Panel, StabilityMap
from .plan_map import Grid, MapPlan, Place
from .predicted import Predictor
from .references import References

#: How `growth` in a study says that modes are fitted.
_MODES = "modes"


def map_study(plan: MapPlan, bench: Bench) -> StabilityMap:
    """Run what is missing of a study, and map it.

    InputError for a measure that the scenario does not have, for a theory that does not fit it, and for a reference in
    a folder without results.
    """
    # The matrices of modes and theories are small: BLAS's threads cost more than they bring.
    with threadpool_limits(limits=1):
        return _Mapping(plan, bench).whole()


class _Mapping:
    """A map in the making."""

    def __init__(self, plan: MapPlan, bench: Bench) -> None:
        self._plan, self._bench = plan, bench
        self._study = plan.study
        every = [place for grid in plan.grids for place in grid.places]
        self._references = References(bench, plan.origin)
        self._references.run(every)
        self._accuracy = Accuracy(
            self._study.tolerances, self._study.measures or (), self._references.runs, plan.origin
        )
        self._predictor = None if plan.theory is None else Predictor(plan.theory, plan.base, plan.origin)
        # All places of each panel that were run; theory may look at the moments of their references.
        self._places = [list(grid.places) for grid in plan.grids]

    def whole(self) -> StabilityMap:
        """The map."""
        plan, study = self._plan, self._study
        every = [place for grid in plan.grids for place in grid.places]
        # A theory that does not fit is told before hours of runs.
        for place in every:
            self._predicted(place)
        cells = iter(self._cells(every, study.name))
        own = [[next(cells) for _ in grid.places] for grid in plan.grids]
        found = [brackets(grid.x, grid.y, of, self._holds) for grid, of in zip(plan.grids, own, strict=True)]
        bisected = self._halve(found)
        panels = [
            self._panel(grid, self._places[number], [*own[number], *bisected[number]], found[number])
            for number, grid in enumerate(plan.grids)
        ]
        return StabilityMap(
            study.name,
            study.scenario,
            panels,
            "" if plan.theory is None else plan.theory.name,
            "" if plan.theory is None else plan.theory.formula,
            dict(study.tolerances),
            plan.references_told,
            machine(),
            _versions(panels),
            self._notes(panels),
        )

    # --- cells --------------------------------------------------------------------------------------------------------

    def _cells(self, places: Sequence[Place], title: str) -> list[Cell]:
        """The cells of places whose references were run."""
        trials = iter(self._bench.run([place.point for place in places if place.point is not None], title))
        return [self._cell(place, None if place.point is None else next(trials)) for place in places]

    def _cell(self, place: Place, trial: Trial | None) -> Cell:
        if trial is None:
            return Cell(place.x, place.y, NOT_RUN, place.reason, bisected=place.bisected)
        # Its results are let go with the copy: hundreds of time series are more than need be kept.
        read = replace(trial)
        judgement = self._accuracy.judged(read, self._references.of(place))
        verdict = classified(read, judgement, self._study.growth == _MODES)
        return Cell(
            place.x,
            place.y,
            verdict.kind,
            verdict.reason,
            verdict.measure,
            self._predicted(place),
            judgement.errors,
            trial,
            place.bisected,
        )

    def _predicted(self, place: Place) -> float | None:
        if self._predictor is None or place.point is None:
            return None
        return self._predictor.amplification(place.point.scenario, self._references.folder(place))

    def _holds(self, cell: Cell) -> bool:
        """Whether a cell is on the good side: a theory speaks of stability, unless accuracy is asked for."""
        return cell.is_stable if self._predictor is not None and not self._study.tolerances else cell.is_sound

    # --- the boundary as it is measured -------------------------------------------------------------------------------

    def _halve(self, found: list[list[Bracket]]) -> list[list[Cell]]:
        """Halve all brackets so often as the study says, in their place; the cells that this made, by panel."""
        made: list[list[Cell]] = [[] for _ in found]
        for level in range(self._study.bisect):
            places = [
                [self._between(grid, bracket) for bracket in own]
                for grid, own in zip(self._plan.grids, found, strict=True)
            ]
            every = [place for own in places for place in own if place is not None]
            self._references.run(every)
            for known, new in zip(self._places, places, strict=True):
                known += [place for place in new if place is not None]
            cells = iter(self._cells(every, f"halving {level + 1}") if every else ())
            for number, own in enumerate(found):
                middles = [None if place is None else next(cells) for place in places[number]]
                made[number] += [cell for cell in middles if cell is not None]
                found[number] = [each.halved(cell, self._holds) for each, cell in zip(own, middles, strict=True)]
        return made

    def _between(self, grid: Grid, bracket: Bracket) -> Place | None:
        value = middle(grid.y, bracket)
        place = None if value is None else self._plan.between(grid, bracket.x, value)
        return place if place is not None and bracket.low.y < place.y < bracket.high.y else None

    # --- the boundary as it is predicted ------------------------------------------------------------------------------

    def _panel(self, grid: Grid, places: Sequence[Place], cells: Sequence[Cell], found: Sequence[Bracket]) -> Panel:
        limit = self._limit(grid, places)
        crossings = [self._crossing(grid, bracket, limit) for bracket in found]
        curves = limit.curves() if limit is not None and grid.x.is_numeric and grid.y.is_numeric else []
        return Panel(grid.line.name, grid.x.key, grid.y.key, grid.x.values, grid.y.values, cells, crossings, curves)

    def _crossing(self, grid: Grid, bracket: Bracket, limit: Limit | None) -> Crossing:
        crossing = Crossing(bracket.x, float(bracket.low.y), float(bracket.high.y))
        if limit is None:
            return crossing
        return replace(crossing, predicted=nearest(grid.y, limit.at(bracket.x), crossing.measured))

    def _limit(self, grid: Grid, places: Sequence[Place]) -> Limit | None:
        predictor = self._predictor
        if predictor is None or not grid.y.is_numeric:
            return None

        def amplification(x: Any, y: float) -> float | None:
            place = _nearest_place(grid, places, x, y)
            if place.point is None or not predictor.applies(place.point.scenario):
                return None
            try:
                scenario = self._plan.scenario(grid, x, y)
            except InputError:
                # A key of whole numbers has nothing between them; contradictions are those of the run's length.
                return None
            return predictor.amplification(scenario, self._references.folder(place))

        return Limit(grid.x, grid.y, amplification, predictor.is_costly)

    # --- what else is to be known -------------------------------------------------------------------------------------

    def _notes(self, panels: Sequence[Panel]) -> list[str]:
        cells = [cell for panel in panels for cell in panel.cells]
        notes = []
        unjudged = sum("not judged for accuracy" in cell.reason for cell in cells)
        if unjudged:
            notes.append(f"{unjudged} of {len(cells)} cells are not judged for accuracy; their reasons say why")
        infinite = sum(any(not isfinite(error) for error in cell.errors.values()) for cell in cells)
        if infinite:
            notes.append(
                f"infinite error: {infinite} of {len(cells)} cells lack a quantity that their reference has, or have "
                "one that it lacks"
            )
        bugs = sum(cell.reason.startswith(BUG) for cell in cells)
        if bugs:
            notes.append(
                f"{bugs} of {len(cells)} cells ended with an error in this program; their reasons begin with '{BUG}'"
            )
        if len(self._study.references) > 1:
            notes.append("errors are taken from the first reference; the second one is not run for a map")
        silent = sum(cell.predicted is None and cell.trial is not None for cell in cells)
        if self._predictor is not None and silent:
            notes.append(
                f"theory predicts nothing for {silent} of {len(cells)} cells: it applies to explicit coupling with "
                "equal steps only, or has no result there"
            )
        return notes


def _nearest_place(grid: Grid, places: Sequence[Place], x: Any, y: float) -> Place:
    """The one of the places that is nearest to values on the axes of the grid, along x first."""

    def apart(axis: Axis, value: Any, other: Any) -> float:
        return abs(axis.place(value) - axis.place(other)) if axis.is_numeric else float(value != other)

    runnable = [place for place in places if place.point is not None] or places
    return min(runnable, key=lambda place: (apart(grid.x, place.x, x), apart(grid.y, place.y, y)))


def _versions(panels: Sequence[Panel]) -> Mapping[str, str]:
    """Those of the first run that says them."""
    trials = (cell.trial for panel in panels for cell in panel.cells if cell.trial is not None)
    return next((found for trial in trials if (found := trial.run.summary.get("versions"))), {})
