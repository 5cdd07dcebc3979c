"""The errors that units make inside, by the parameters that they declare to decide them."""

from collections.abc import Iterator

from ...orchestrator.participants.native import accuracy_parameters, is_memoryless
from ...orchestrator.scenario import Scenario
from .internal_steps import InternalStep, internal_steps
from .source import COARSER, FINER, LEVELS, TOLERANCE_ORDER, TOLERANCE_RATIO, Level, Source


def internal(scenario: Scenario) -> list[Source]:
    """The internal steps, own meshes and internal tolerances of all units."""
    steps = internal_steps(scenario)
    return [
        *(_step(step, scenario.coupling.adaptive is not None, _labelled(step, steps)) for step in steps),
        *(_mesh(unit, key, refine) for unit, key, refine in _parameters(scenario, "mesh")),
        *(_tolerance(unit, key, limit) for unit, key, limit in _parameters(scenario, "tolerance")),
    ]


def other_meshes(scenario: Scenario) -> Source | None:
    """The mesh on which fields are exchanged and all units solve that have none of their own; None without a scene."""
    if scenario.scene is None:
        return None
    own = {key: int(refine) for _, key, refine in _parameters(scenario, "mesh")}
    refine = scenario.scene.refine
    levels = {0: Level({})}
    if refine > 0:
        # Units with their own meshes solve on the same as before.
        levels[COARSER] = Level({"scene.refine": refine - 1} | {key: level + 1 for key, level in own.items()})
    at_once = bool(own) and all(level >= max(LEVELS) for level in own.values())
    for level in range(FINER, max(LEVELS) + 1):
        scene = {"scene.refine": refine + level}
        if at_once:
            levels[level] = Level(scene | {key: inner - level for key, inner in own.items()})
        else:
            finer = {key: inner + level for key, inner in own.items()}
            levels[level] = Level(scene, finer if own else None)
    less = ", less what that changes for the units that can refine their own mesh" if own else ""
    other = "take a smaller `scene.mesh_size_mm`" if scenario.scene.mesh is None else "bring a finer mesh"
    return Source(
        _shared(scenario) if own else "mesh",
        f"`scene.refine` + 1{less}",
        "the mesh size",
        levels,
        f"raise `scene.refine`, or {other}",
    )


def _shared(scenario: Scenario) -> str:
    """Who solves on the scene's mesh, where others have meshes of their own: the units in equilibrium."""
    solving = [name for name, entry in scenario.units.items() if entry.unit is not None and is_memoryless(entry.unit)]
    return f"{' and '.join(solving)} mesh" if solving else "mesh of the other units"


def _step(step: InternalStep, adaptive: bool, name: str) -> Source:
    """Under fixed exchanges halves of the step that is taken, under others halves of the longest that is allowed."""
    now = step.longest_ms if adaptive else step.taken_ms()
    levels = {level: Level({step.key: now * 2.0**-level} if level else {}) for level in LEVELS}
    doubled = step.whole_ms / (2.0 * now)
    if not adaptive and (round(doubled) < 1 or abs(doubled - round(doubled)) > 1e-9 * doubled):
        # No internal step is longer than the communication step, and they are whole in number.
        del levels[COARSER]
    return Source(
        name, f"half of the internal step, now {now:g} ms", "the step's length", levels, f"lower `{step.key}`"
    )


def _labelled(step: InternalStep, steps: list[InternalStep]) -> str:
    alone = sum(other.unit == step.unit for other in steps) == 1
    return f"{step.unit} sub-step" if alone else f"{step.unit} {step.name}"


def _mesh(unit: str, key: str, refine: float) -> Source:
    levels = {level: Level({key: int(refine) + level} if level else {}) for level in LEVELS}
    return Source(f"{unit} mesh", f"`{key}` + 1", "the mesh size", levels, f"raise `{key}`")


def _tolerance(unit: str, key: str, limit: float) -> Source:
    levels = {level: Level({key: limit * TOLERANCE_RATIO**-level} if level else {}) for level in LEVELS}
    name = key.rpartition(".")[2].replace("_", " ")
    return Source(
        f"{unit} {name}",
        f"a quarter of `{key}`",
        "the tolerance",
        levels,
        f"lower `{key}`",
        TOLERANCE_RATIO,
        TOLERANCE_ORDER,
    )


def _parameters(scenario: Scenario, kind: str) -> Iterator[tuple[str, str, float]]:
    """The unit, the key and the value of all parameters of a kind."""
    for unit, entry in scenario.units.items():
        if entry.unit is not None:
            for name, parameter in accuracy_parameters(entry.unit).items():
                if parameter.kind == kind:
                    value = entry.parameters.get(name, parameter.default)
                    yield unit, f"units.{unit}.parameters.{name}", value
