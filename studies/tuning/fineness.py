"""Which settings of a scenario make it finer and dearer, as far as that is known of a key, whatever it is about."""

from collections.abc import Iterator, Mapping
from typing import Any

from ...orchestrator.participants.native import accuracy_parameters
from ...orchestrator.scenario import Scenario

#: Keys whose value makes a run cheaper as it grows, and the one that makes it dearer.
_CHEAPER = ("coupling.step_ms", "coupling.adaptive.tolerance", "scene.mesh_size_mm")
_DEARER = ("scene.refine",)

#: Limits of an iteration that make it cheaper as they grow: `coupling.iterate.converge.<field>.<limit>`.
_CONVERGE = "coupling.iterate.converge."

#: Of a unit's parameters those of these kinds make it cheaper as they grow, all others that decide its error dearer.
_CHEAPER_KINDS = ("step", "tolerance")


def ordered(settings: Mapping[str, Any], scenario: Scenario) -> tuple[dict[str, float], dict[str, Any]]:
    """Settings as coordinates that grow as a scenario becomes finer and dearer, and those that have no known order."""
    coordinates, rest = {}, {}
    for key, value in _leaves(settings):
        sign = _sign(key, scenario) if isinstance(value, int | float) and not isinstance(value, bool) else 0
        if sign:
            coordinates[key] = sign * float(value)
        else:
            rest[key] = value
    return coordinates, rest


def _leaves(settings: Mapping[str, Any], parent: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, f"{parent}{key}.")
        else:
            yield f"{parent}{key}", value


def _sign(key: str, scenario: Scenario) -> int:
    """+1 for a key whose growing value makes a run finer, -1 for one that makes it coarser, 0 where that is unknown."""
    if key in _CHEAPER or key.startswith(_CONVERGE):
        return -1
    if key in _DEARER:
        return 1
    section, *names = key.split(".")
    if section != "units" or len(names) < 2 or names[0] not in scenario.units:
        return 0
    unit, kind = scenario.units[names[0]].unit, names[1:]
    if kind == ["every"]:
        return -1
    if unit is None or len(kind) != 2 or kind[0] != "parameters":
        return 0
    declared = accuracy_parameters(unit).get(kind[1])
    if declared is None:
        return 0
    return -1 if declared.kind in _CHEAPER_KINDS else 1
