"""What the candidates of a scenario are compared with: much finer steps, inside of the units and between them."""

from collections.abc import Mapping
from typing import Any

from ...orchestrator.scenario import Scenario
from ..internals import internals
from .steps import step_below

#: The communication step of the reference over the scenario's, which counts as no longer than this.
_STEP, _LONGEST_MS = 0.1, 1.0

#: Internal steps and tolerances over the scenario's, of the reference and of the second one, which is less fine.
_FINE = {"step": (0.25, 0.5), "tolerance": (0.01, 0.1)}


def references_of(scenario: Scenario, finer_mesh: bool) -> list[dict[str, Any]]:
    """The settings of the reference and of a second, less fine one, whose difference is the first's uncertainty.

    Inputs are linear. Where the scenario iterates, so do they, to a tolerance that is as much finer as those inside.
    With `finer_mesh` the mesh is finer too, that of the second one less so where it can have any size.
    """
    step_ms = step_below(scenario, _STEP * min(scenario.coupling.step_ms, _LONGEST_MS))
    steps = (step_ms, step_below(scenario, 2.0 * step_ms))
    return [
        {
            "coupling.scheme": "gauss-seidel",
            "coupling.adaptive": None,
            "coupling.step_ms": steps[which],
            "coupling.interpolation": "linear",
            "coupling.extrapolation": 1,
            **_iteration(scenario, _FINE["tolerance"][which]),
            **{each.key: each.times(_FINE[each.declared.kind][which]) for each in internals(scenario, *_FINE)},
            **(_mesh(scenario, which) if finer_mesh else {}),
        }
        for which in (0, 1)
    ]


def _iteration(scenario: Scenario, factor: float) -> Mapping[str, Any]:
    """The limits of the scenario's iteration times a factor; nothing where it has none."""
    iterate = scenario.coupling.iterate
    if iterate is None:
        return {}
    content = iterate.model_dump(by_alias=True)
    return {"coupling.iterate": {**content, "converge": iterate.limits_times(factor), "on_limit": "warn"}}


def _mesh(scenario: Scenario, which: int) -> Mapping[str, Any]:
    scene = scenario.scene
    if scene is None:
        return {}
    if scene.mesh is None:
        return {"scene.mesh_size_mm": float(f"{scene.mesh_size_mm * (0.5, 0.65)[which]:.3g}")}
    return {"scene.refine": scene.refine + 1}
