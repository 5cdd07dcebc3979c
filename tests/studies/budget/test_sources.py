"""If these fail, an error has no bar, or the bar of one source holds the error of another."""

from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario
from cardiac_cosim.studies.budget.internal_steps import InternalStep
from cardiac_cosim.studies.budget.source import LEVELS, Source
from cardiac_cosim.studies.budget.sources import sources_of, unknown_sources

_SCENARIOS = Path(__file__).parents[3] / "scenarios"
_SUBSTEP = "units.electrophysiology.parameters.longest_substep_ms"
_REFINE = "units.electrophysiology.parameters.refine"
_TOLERANCE = "units.mechanics.parameters.equilibrium_tolerance"


def _sources(name: str, *sets: str) -> dict[str, Source]:
    return {source.name: source for source in sources_of(load_scenario(_SCENARIOS / f"{name}.yaml", sets))}


def _settings(source: Source) -> dict[int, Any]:
    return {level: dict(at.settings) for level, at in source.levels.items()}


def test_a_heartbeat_has_errors_of_coupling_substep_meshes_and_equilibrium() -> None:
    sources = _sources("baseline")
    assert list(sources) == [
        "communication step",
        "electrophysiology sub-step",
        "electrophysiology mesh",
        "mechanics equilibrium tolerance",
        "mechanics mesh",
    ]
    assert _settings(sources["communication step"]) == {
        -1: {"coupling.step_ms": 2.0},
        0: {},
        1: {"coupling.step_ms": 0.5},
        2: {"coupling.step_ms": 0.25},
    }
    assert _settings(sources["electrophysiology sub-step"]) == {
        -1: {_SUBSTEP: 0.5},
        0: {},
        1: {_SUBSTEP: 0.125},
        2: {_SUBSTEP: 0.0625},
    }
    assert _settings(sources["electrophysiology mesh"])[2] == {_REFINE: 2}
    assert _settings(sources["mechanics equilibrium tolerance"])[1] == {_TOLERANCE: 2.5e-7}
    assert sources["mechanics equilibrium tolerance"].ratio == 4.0
    # Both meshes are finer with the scene's, and one of them alone.
    finest = sources["mechanics mesh"].levels[2]
    assert finest.runs == [{"scene.refine": 2}, {_REFINE: 2}]
    assert -1 not in sources["mechanics mesh"].levels


def test_sources_that_a_scenario_does_not_have_are_left_out() -> None:
    # The mechanics of these is solved exactly.
    for name in ("strand", "cell"):
        assert "mechanics equilibrium tolerance" not in _sources(name)
        assert "iteration tolerance" not in _sources(name)
    iterated = _sources("strand", "coupling.iterate={converge: {stretch: {relative: 1e-4, absolute: 0.1}}}")
    assert _settings(iterated["iteration tolerance"])[2] == {
        "coupling.iterate.converge": {"stretch": {"relative": 1e-4 / 16, "absolute": 0.1 / 16}},
        "coupling.iterate.max_iterations": 80,
    }
    limits = _sources("strand", "coupling.iterate={converge: {mechanics.stretch: {residual-relative: 4e-4}}}")
    assert _settings(limits["iteration tolerance"])[1]["coupling.iterate.converge"] == {
        "mechanics.stretch": {"residual-relative": 1e-4}
    }


def test_adaptive_steps_are_refined_by_their_tolerance() -> None:
    sources = _sources("strand", "coupling.adaptive={tolerance: 0.08, min_ms: 0.5, max_ms: 5}")
    assert _settings(sources["communication step"])[1] == {
        "coupling.adaptive.tolerance": 0.02,
        "coupling.adaptive.min_ms": 0.25,
        "coupling.adaptive.max_ms": 2.5,
        "coupling.step_ms": 0.5,
    }
    assert "tolerance" in sources["communication step"].refined


def test_foreign_fmus_have_the_errors_of_their_coupling_and_a_note(tmp_path: Path) -> None:
    scenario = Scenario.model_validate({"name": "foreign", "units": {"left": {"fmu": "x.fmu"}}})
    assert [source.name for source in sources_of(scenario)] == ["communication step"]
    (note,) = unknown_sources(scenario)
    assert "'left' is an FMU" in note


def test_a_coarser_scene_leaves_the_meshes_of_units_as_they_are() -> None:
    others = _sources("strand", "scene.refine=1", f"{_REFINE}=2")["mechanics mesh"]
    assert {level: list(at.runs) for level, at in others.levels.items()} == {
        -1: [{"scene.refine": 0, _REFINE: 3}],
        0: [{}],
        # What the units do not need of their own refinement, the scene has: nothing has to be compared.
        1: [{"scene.refine": 2, _REFINE: 1}],
        2: [{"scene.refine": 3, _REFINE: 0}],
    }


@pytest.mark.parametrize(
    ("step_ms", "every", "substep_ms", "kept_ms"),
    [(1.0, 1, 0.25, 0.25), (1.0, 1, 0.3, 0.25), (0.5, 1, 0.25, 0.125), (0.5, 2, 0.25, 0.25), (0.2, 1, 0.25, 0.05)],
)
def test_shorter_communication_steps_do_not_shorten_substeps(
    step_ms: float, every: int, substep_ms: float, kept_ms: float
) -> None:
    scenario = load_scenario(
        _SCENARIOS / "strand.yaml",
        [
            f"coupling.step_ms={step_ms}",
            f"{_SUBSTEP}={substep_ms}",
            f"units.electrophysiology.every={every}",
        ],
    )
    source = next(source for source in sources_of(scenario) if source.name == "communication step")
    assert set(source.levels) == set(LEVELS)
    for level, at in source.levels.items():
        longest = at.settings.get(_SUBSTEP, substep_ms)
        taken = InternalStep("electrophysiology", "longest_substep_ms", longest, step_ms * every).taken_ms(level)
        assert taken == pytest.approx(kept_ms), level


def test_a_substep_is_doubled_only_where_it_then_divides_the_step() -> None:
    assert _settings(_sources("strand", f"{_SUBSTEP}=0.34")["electrophysiology sub-step"]) == {
        0: {},
        1: {_SUBSTEP: pytest.approx(1.0 / 6.0)},
        2: {_SUBSTEP: pytest.approx(1.0 / 12.0)},
    }
    assert -1 not in _sources("strand", f"{_SUBSTEP}=1")["electrophysiology sub-step"].levels
    assert _settings(_sources("strand", f"{_SUBSTEP}=0.6")["electrophysiology sub-step"])[-1] == {_SUBSTEP: 1.0}
