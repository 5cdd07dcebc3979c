"""How finely the units solve inside, and on which mesh: axes of a search, whose levels go from coarse to fine."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...orchestrator.scenario import Scenario
from ..internals import Internal, internals

#: What the scenario's own internal steps and tolerances are multiplied by, coarse to fine.
_FACTORS = {"step": (4.0, 2.0, 1.0, 0.5), "tolerance": (100.0, 10.0, 1.0, 0.1)}

#: How many levels that makes, and which is the scenario's own.
_LEVELS, _OWN = 4, 2

#: Parameters that are varied independently of each other; of more, those of a kind are varied together.
_MOST_APART = 3

#: Sizes of the elements over the scenario's, coarse to fine.
_SIZES = (2.0, 1.5, 1.25, 1.0, 0.8, 0.65)


@dataclass(frozen=True)
class Axis:
    """`levels` are settings, from the coarsest to the finest; the scenario's own are at the place `own`.

    `is_step` says whether they are internal time steps.
    """

    name: str
    levels: Sequence[Mapping[str, Any]]
    own: int
    is_step: bool = False


def accuracy_axes(scenario: Scenario, together: bool = False) -> list[Axis]:
    """An axis for each internal step and tolerance of the units; of many one for all of a kind, or one `together`."""
    every = {kind: internals(scenario, kind) for kind in _FACTORS}
    if together:
        return [_axis("internal accuracy", [each for found in every.values() for each in found])]
    if sum(map(len, every.values())) > _MOST_APART:
        return [_axis(f"every internal {kind}", found) for kind, found in every.items() if found]
    return [_axis(each.key, [each]) for kind, found in every.items() for each in found]


def mesh_axes(scenario: Scenario) -> list[Axis]:
    """The size or refinement of the scene's mesh, and the nested refinement of each unit; none without a scene."""
    if scenario.scene is None:
        return []
    refine, axes = scenario.scene.refine, []
    if scenario.scene.mesh is None:
        size = scenario.scene.mesh_size_mm
        sizes = [float(f"{size * factor:.3g}") if factor != 1.0 else size for factor in _SIZES]
        axes.append(Axis("scene.mesh_size_mm", [{"scene.mesh_size_mm": each} for each in sizes], _SIZES.index(1.0)))
    elif refine:
        levels = [{"scene.refine": level} for level in range(refine + 1)]
        axes.append(Axis("scene.refine", levels, refine))
    for each in internals(scenario, "mesh"):
        levels = [{each.key: level} for level in range(int(each.own) + 2)]
        axes.append(Axis(each.key, levels, int(each.own)))
    return axes


def _axis(name: str, found: Sequence[Internal]) -> Axis:
    own = {each.key: each.own for each in found}
    levels: list[dict[str, Any]] = []
    for place in range(_LEVELS):
        level = {each.key: each.times(_FACTORS[each.declared.kind][place]) for each in found}
        level = own if place == _OWN else level
        if level not in levels:
            levels.append(level)
    return Axis(name, levels, levels.index(own), {each.declared.kind for each in found} == {"step"})


def combined(axes: Sequence[Axis]) -> Iterator[tuple[dict[str, Any], dict[str, float], bool]]:
    """Every combination of levels: its settings, the place on each axis, and whether it is the scenario's own."""
    if not axes:
        yield {}, {}, True
        return
    first, *others = axes
    for place, level in enumerate(first.levels):
        for settings, places, is_own in combined(others):
            yield {**level, **settings}, {first.name: float(place), **places}, is_own and place == first.own
