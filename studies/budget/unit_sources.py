"""The errors that units make inside, by the parameters that they declare to decide them."""

from ...orchestrator.participants.native import is_memoryless
from ...orchestrator.scenario import Scenario, is_whole
from ..internals import Internal, internals
from .internal_steps import InternalStep, internal_steps
from .source import COARSER, FINER, LEVELS, TOLERANCE_ORDER, TOLERANCE_RATIO, Level, Source


def internal(scenario: Scenario) -> list[Source]:
    """The internal steps, own meshes and internal tolerances of all units."""
    steps = internal_steps(scenario)
    return [
        *(_step(step, scenario.coupling.adaptive is not None, _labelled(step, steps)) for step in steps),
        *(_mesh(each) for each in internals(scenario, "mesh")),
        *(_tolerance(each) for each in internals(scenario, "tolerance")),
    ]


def other_meshes(scenario: Scenario) -> Source | None:
    """The mesh on which fields are exchanged and all units solve that have none of their own; None without a scene."""
    if scenario.scene is None:
        return None
    own = {each.key: int(each.own) for each in internals(scenario, "mesh")}
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
    less = ", minus the change in the units that can refine their own mesh" if own else ""
    other = "take a smaller `scene.mesh_size_mm`" if scenario.scene.mesh is None else "give a finer mesh"
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
    if not adaptive and not is_whole(doubled):
        # No internal step is longer than the communication step, and they are whole in number.
        del levels[COARSER]
    return Source(
        name, f"half of the internal step, now {now:g} ms", "the step's length", levels, f"lower `{step.key}`"
    )


def _labelled(step: InternalStep, steps: list[InternalStep]) -> str:
    alone = sum(other.unit == step.unit for other in steps) == 1
    return f"{step.unit} sub-step" if alone else f"{step.unit} {step.name}"


def _mesh(refine: Internal) -> Source:
    key = refine.key
    levels = {level: Level({key: int(refine.own) + level} if level else {}) for level in LEVELS}
    return Source(f"{refine.unit} mesh", f"`{key}` + 1", "the mesh size", levels, f"raise `{key}`")


def _tolerance(limit: Internal) -> Source:
    key = limit.key
    levels = {level: Level({key: limit.own * TOLERANCE_RATIO**-level} if level else {}) for level in LEVELS}
    return Source(
        f"{limit.unit} {limit.declared.name.replace('_', ' ')}",
        f"a quarter of `{key}`",
        "the tolerance",
        levels,
        f"lower `{key}`",
        TOLERANCE_RATIO,
        TOLERANCE_ORDER,
    )
