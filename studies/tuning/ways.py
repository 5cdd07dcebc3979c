"""Ways of coupling that are worth trying with a scenario."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...orchestrator.assembly import assemble, called_directly, checked_mesh
from ...orchestrator.coupling.loops import groups_in_order, inside
from ...orchestrator.coupling.master import stepping_order
from ...orchestrator.scenario import Scenario
from .steps import communication_steps

_EXPLICIT: Mapping[str, Any] = {"coupling.iterate": None, "coupling.adaptive": None}
_HELD: Mapping[str, Any] = {"coupling.interpolation": "hold", "coupling.extrapolation": 0}
_LINEAR: Mapping[str, Any] = {"coupling.interpolation": "linear", "coupling.extrapolation": 1}

#: Tolerances of adaptive steps, and relative ones of an iteration, coarse to fine.
_ADAPTIVE = (0.5, 0.2, 0.1, 0.05, 0.02)
_ITERATED = (1e-2, 1e-3, 1e-4)

#: The shortest and the longest adaptive step over the scenario's own.
_SHORTEST, _LONGEST = 0.5, 20.0


@dataclass(frozen=True)
class Way:
    """A way of coupling: its settings, and `levels` of what makes it finer, from the coarsest to the finest.

    Ways of one `group` differ in `coordinates` only, which grow as they become finer and dearer.
    """

    name: str
    settings: Mapping[str, Any]
    levels: Sequence[Mapping[str, Any]]
    group: str
    coordinates: Mapping[str, float] = field(default_factory=dict)


def ways_of_coupling(scenario: Scenario, base: Path) -> list[Way]:
    """The ways for `scenario`, whose paths are relative to `base`; its own is the last, if it is none of the others."""
    coupling = scenario.coupling
    steps = [{"coupling.step_ms": step} for step in communication_steps(scenario)]
    gauss_seidel, jacobi = {"coupling.scheme": "gauss-seidel"}, {"coupling.scheme": "jacobi"}
    ways = [
        _explicit("Gauss–Seidel, held", {**_EXPLICIT, **gauss_seidel, **_HELD}, steps),
        good_way(steps),
        _explicit("Jacobi, linear", {**_EXPLICIT, **jacobi, **_LINEAR}, steps),
    ]
    fields = _loop_fields(scenario, base)
    for limit in _ITERATED if fields else ():
        iterate = {"acceleration": "anderson", "converge": {name: {"relative": limit} for name in fields}}
        settings = {**_EXPLICIT, **gauss_seidel, **_LINEAR, "coupling.iterate": iterate}
        name = "iterated Gauss–Seidel, linear"
        ways.append(Way(f"{name}, to {limit:g}", settings, steps, name, {"iterate": -limit}))
    own = coupling.adaptive
    shortest = coupling.step_ms * _SHORTEST if own is None else own.min_ms
    longest = coupling.step_ms * _LONGEST if own is None else own.max_ms
    tolerances = sorted({*_ADAPTIVE, *([] if own is None else [own.tolerance])}, reverse=True)
    levels = [{"coupling.adaptive": {"tolerance": each, "min_ms": shortest, "max_ms": longest}} for each in tolerances]
    settings = {"coupling.iterate": None, **gauss_seidel, **_LINEAR}
    ways.append(_explicit("Gauss–Seidel, linear, adaptive", settings, levels))
    if not any(_is(way.settings, scenario) for way in ways):
        ways.append(_explicit("as the scenario couples", {}, steps if own is None else levels))
    return ways


def good_way(steps: Sequence[Mapping[str, Any]]) -> Way:
    """A cheap way that is good for most scenarios."""
    return _explicit("Gauss–Seidel, linear", {**_EXPLICIT, "coupling.scheme": "gauss-seidel", **_LINEAR}, steps)


def _explicit(name: str, settings: Mapping[str, Any], levels: Sequence[Mapping[str, Any]]) -> Way:
    return Way(name, settings, levels, name)


def _is(settings: Mapping[str, Any], scenario: Scenario) -> bool:
    own = scenario.resolved()["coupling"]
    adapts = own["adaptive"] is not None
    return adapts == ("coupling.adaptive" not in settings) and all(
        own[key.removeprefix("coupling.")] == value for key, value in settings.items()
    )


def _loop_fields(scenario: Scenario, base: Path) -> list[str]:
    """A field of each loop, `unit.field`; its convergence is enough, for the others are held to the same."""
    with ExitStack() as stack:
        direct = called_directly(scenario)
        assembly = assemble(stack, direct, base, checked_mesh(direct, base), described=True)
        order = stepping_order(assembly.participants, scenario.coupling.order)
        groups = [group for group in groups_in_order(order, assembly.connections) if group.is_loop]
        return [str(inside(group.units, assembly.connections)[0].source) for group in groups]
