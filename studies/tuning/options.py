"""What a search chooses among: settings of a scenario, on the lines of a chart, and as candidates of the search."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from ...orchestrator.errors import InputError
from ...orchestrator.scenario import Contradiction, Scenario
from ..plan import Plan, Variants
from ..point import Point, told
from .axes import Axis, accuracy_axes, combined, mesh_axes
from .fineness import ordered
from .search import Candidate
from .steps import communication_steps, step_below
from .ways import Way, good_way, ways_of_coupling

#: The line of the scenario without any change.
AS_IT_IS = "the scenario as it is"


@dataclass(frozen=True)
class Option:
    """A point of a `line`, which differs from others of the line in what is `shown`, from the scenario in `settings`.

    `point` is None where its settings cannot stand together; `reason` says why.
    """

    line: str
    shown: Mapping[str, Any]
    settings: Mapping[str, Any]
    candidate: Candidate
    point: Point | None
    reason: str = ""


def options_of_study(plan: Plan, scenario: Scenario) -> list[Option]:
    """The points of a study's lines."""
    found = []
    for line in plan.study.lines:
        for planned in plan.lines[line.name]:
            settings = {**line.set, **planned.settings}
            coordinates, rest = ordered(settings, scenario)
            group = (line.name, str(sorted((key, repr(value)) for key, value in rest.items())))
            candidate = Candidate(_name(line.name, planned.settings), group, coordinates)
            found.append(Option(line.name, planned.settings, settings, candidate, planned.point, planned.reason))
    return found


def options_of_scenario(variants: Variants, scenario: Scenario, base: Path) -> list[Option]:
    """Ways of coupling, times communication steps, times how finely the units solve inside.

    First come the ways with the scenario's own internal accuracy, which lead the others.
    """
    axes, make = accuracy_axes(scenario), _maker(variants)
    found = []
    for way, (settings, places, is_own) in product(ways_of_coupling(scenario, base), combined(axes)):
        for place, step in enumerate(way.levels):
            if _is_idle(axes, settings, step):
                continue
            lead = _name(way.name, step)
            line, shown = (way.name, step) if is_own else (_varied(way), {**step, **settings})
            candidate = _candidate(
                way, place, _name(line, shown), places, 0 if is_own else 1, () if is_own else (lead,)
            )
            found.append(make(line, shown, {**way.settings, **step, **_changes(axes, settings)}, candidate))
    return found


def options_on_meshes(variants: Variants, scenario: Scenario, base: Path) -> list[Option]:
    """Meshes, times ways of coupling, times communication steps, times how finely the units solve inside.

    First come the meshes with one good coupling, then the couplings with the scenario's own internal accuracy.
    """
    make, ways = _maker(variants), ways_of_coupling(scenario, base)
    axes, meshes = accuracy_axes(scenario, together=True), mesh_axes(scenario)
    good = good_way([{"coupling.step_ms": step} for step in communication_steps(scenario)]).name
    middle = {"coupling.step_ms": step_below(scenario, scenario.coupling.step_ms)}
    found = []
    for mesh, mesh_places, _ in combined(meshes):
        for way, (settings, places, is_own) in product(ways, combined(axes)):
            for place, step in enumerate(way.levels):
                if _is_idle(axes, settings, step):
                    continue
                shown = {**mesh, **step} if is_own else {**mesh, **step, **settings}
                first, second = _name(good, {**mesh, **middle}), _name(way.name, {**mesh, **step})
                line = way.name if is_own else _varied(way)
                name = _name(line, shown)
                phase = 0 if name == first else 1 if is_own else 2
                leads = [lead for lead in (first, second) if lead != name] if phase else []
                candidate = _candidate(way, place, name, {**mesh_places, **places}, phase, leads)
                changes = {**_changes(meshes, mesh), **_changes(axes, settings)}
                found.append(make(line, shown, {**way.settings, **step, **changes}, candidate))
    return found


def _maker(variants: Variants) -> Callable[[str, Mapping[str, Any], Mapping[str, Any], Candidate], Option]:
    def make(line: str, shown: Mapping[str, Any], settings: Mapping[str, Any], candidate: Candidate) -> Option:
        try:
            return Option(line, shown, settings, candidate, variants.point(settings))
        except Contradiction as error:
            return Option(line, shown, settings, candidate, None, error.problem)
        except InputError as error:
            # A value that the unit does not take.
            return Option(line, shown, settings, candidate, None, str(error))

    return make


def _candidate(
    way: Way, place: int, name: str, places: Mapping[str, float], phase: int, leads: Iterable[str]
) -> Candidate:
    return Candidate(name, way.group, {**way.coordinates, "coupling": float(place), **places}, phase, tuple(leads))


def _changes(axes: Sequence[Axis], settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that are not the scenario's own."""
    own = {key: value for axis in axes for key, value in axis.levels[axis.own].items()}
    return {key: value for key, value in settings.items() if value != own[key]}


def _is_idle(axes: Sequence[Axis], settings: Mapping[str, Any], step: Mapping[str, Any]) -> bool:
    """Whether an internal step is above the communication step, where one that is not shorter than that is tried too.

    Both are cut to the communication step, and compute the same.
    """
    step_ms = step.get("coupling.step_ms")
    for axis in axes:
        if step_ms is None or not axis.is_step or len(axis.levels[0]) != 1:
            continue
        (key,) = axis.levels[0]
        own = axis.levels[axis.own][key]
        if settings[key] > max(step_ms, own) and any(step_ms <= level[key] < settings[key] for level in axis.levels):
            return True
    return False


def _varied(way: Way) -> str:
    return f"{way.name}, internal accuracy varied"


def _name(line: str, shown: Mapping[str, Any]) -> str:
    return f"{line}, {told(shown)}"
