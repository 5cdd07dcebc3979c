"""If these fail, a setting is not tried that could have won, or one is tried that means nothing."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario
from cardiac_cosim.studies.plan import Variants
from cardiac_cosim.studies.tuning.axes import accuracy_axes, mesh_axes
from cardiac_cosim.studies.tuning.fineness import ordered
from cardiac_cosim.studies.tuning.options import Option, options_of_scenario, options_on_meshes
from cardiac_cosim.studies.tuning.references import references_of
from cardiac_cosim.studies.tuning.steps import communication_steps, step_below
from cardiac_cosim.studies.tuning.ways import ways_of_coupling

_SUBSTEP = "units.electrophysiology.parameters.longest_substep_ms"


def _scenario(file: Path, *assignments: str) -> Scenario:
    return load_scenario(file, assignments)


@pytest.mark.parametrize(
    ("step_ms", "every_ms", "stop_ms", "expected"),
    [
        (1.0, 5.0, 320.0, [5.0, 2.5, 1.0, 0.5, 0.25]),
        (1.0, 20.0, 40.0, [20.0, 10.0, 5.0, 2.5, 2.0, 1.0, 0.5, 0.25]),
        (3.0, 3.0, 9.0, [3.0, 1.0]),
        (0.002, 0.01, 0.05, [0.01, 0.005, 0.0025, 0.002, 0.001, 0.0005]),
    ],
)
def test_steps_divide_the_output_interval_and_the_end(
    strand: Path, step_ms: float, every_ms: float, stop_ms: float, expected: list[float]
) -> None:
    times = (f"coupling.step_ms={step_ms}", f"output.every_ms={every_ms}", f"run.stop_ms={stop_ms}")
    assert communication_steps(_scenario(strand, *times)) == pytest.approx(expected)


def test_a_step_below_a_limit_divides_both_times(strand: Path) -> None:
    assert step_below(_scenario(strand), 0.1) == pytest.approx(0.1)
    assert step_below(_scenario(strand), 0.3) == pytest.approx(5.0 / 17.0)
    # 7.5 ms are no whole number of the steps that divide 5 ms into an odd number of parts.
    assert step_below(_scenario(strand, "run.stop_ms=7.5", "coupling.step_ms=2.5"), 1.1) == pytest.approx(5.0 / 6.0)


def test_the_reference_is_finer_in_everything_that_decides_the_error(strand: Path) -> None:
    first, second = references_of(_scenario(strand), False)
    assert first["coupling.step_ms"] == pytest.approx(0.1)
    assert second["coupling.step_ms"] == pytest.approx(0.2)
    assert (first[_SUBSTEP], second[_SUBSTEP]) == (0.0625, 0.125)
    assert first["coupling.interpolation"] == "linear"
    on_mesh = references_of(_scenario(strand), True)
    assert [each["scene.mesh_size_mm"] for each in on_mesh] == [1.0, 1.3]


def test_the_reference_of_an_iterated_scenario_iterates_farther(small_scenario: Path) -> None:
    iterate = "coupling.iterate={converge: {stretch: {relative: 1e-3}}}"
    first, _ = references_of(_scenario(small_scenario, iterate), False)
    assert first["coupling.iterate"]["converge"] == {"stretch": {"relative": pytest.approx(1e-5)}}


def test_loops_are_iterated_and_scenarios_without_one_are_not(strand: Path, small_scenario: Path) -> None:
    for file in (strand, small_scenario):
        names = [way.name for way in ways_of_coupling(_scenario(file), file.parent)]
        assert any("iterated" in name for name in names)
        assert any("adaptive" in name for name in names)
    without = _scenario(strand, "units.electrophysiology.parameters.stretch_conductance=0")
    assert not any("iterated" in way.name for way in ways_of_coupling(without, strand.parent))


@pytest.mark.parametrize(
    ("assignments", "is_own"),
    [
        ((), False),
        (("coupling.interpolation=linear", "coupling.extrapolation=1"), False),
        (("coupling.scheme=jacobi",), True),
        (("coupling.adaptive={tolerance: 0.3}",), False),
        (("coupling.adaptive={tolerance: 0.3}", "coupling.scheme=jacobi"), True),
    ],
)
def test_the_way_of_the_scenario_is_among_those_tried(strand: Path, assignments: tuple[str, ...], is_own: bool) -> None:
    scenario = _scenario(strand, *assignments)
    names = [way.name for way in ways_of_coupling(scenario, strand.parent)]
    assert ("as the scenario couples" in names) == is_own
    found = _options(strand, *assignments)
    own = {**scenario.resolved(), "name": ""}
    assert any(option.point and {**option.point.scenario.resolved(), "name": ""} == own for option in found)


def _options(file: Path, *assignments: str) -> list[Option]:
    settings = {text.partition("=")[0]: _value(file, text) for text in assignments}
    variants = Variants(file, settings, str(file))
    return options_of_scenario(variants, variants.scenario({}), file.parent)


def _value(file: Path, assignment: str) -> Any:
    found: Any = load_scenario(file, [assignment]).resolved()
    for part in assignment.partition("=")[0].split("."):
        found = found[part]
    return found


def test_internal_steps_that_compute_the_same_are_tried_once(strand: Path) -> None:
    short = [option for option in _options(strand) if option.settings.get("coupling.step_ms") == 0.5]
    tried = {option.settings.get(_SUBSTEP, 0.25) for option in short}
    assert tried == {0.125, 0.25, 0.5}


def test_all_options_differ_and_follow_one_that_is_there(small_scenario: Path) -> None:
    options = _options(small_scenario)
    names = [option.candidate.name for option in options]
    assert len(set(names)) == len(names)
    assert {lead for option in options for lead in option.candidate.leads} <= set(names)
    assert all(option.candidate.leads for option in options if option.candidate.phase)
    assert not any(option.candidate.leads for option in options if not option.candidate.phase)


def test_many_parameters_are_varied_together(small_scenario: Path) -> None:
    text = small_scenario.read_text()
    more = "".join(f"  wave{number}: {{unit: electrophysiology}}\n" for number in range(4))
    small_scenario.write_text(text.replace("  active_stress:", f"{more}  active_stress:"))
    axes = accuracy_axes(load_scenario(small_scenario))
    assert [axis.name for axis in axes] == ["every internal step", "every internal tolerance"]
    assert len(axes[0].levels[0]) == 5
    assert axes[0].levels[0][_SUBSTEP] == 1.0


def test_meshes_around_the_scenarios_are_tried_with_one_coupling_first(strand: Path) -> None:
    scenario = _scenario(strand)
    sizes, wave = mesh_axes(scenario)
    assert [level["scene.mesh_size_mm"] for level in sizes.levels] == [4.0, 3.0, 2.5, 2.0, 1.6, 1.3]
    assert [list(level.values()) for level in wave.levels] == [[0], [1]]
    options = options_on_meshes(Variants(strand, {}, str(strand)), scenario, strand.parent)
    first = [option for option in options if option.candidate.phase == 0]
    assert len(first) == len(sizes.levels) * len(wave.levels)
    assert len({option.line for option in first}) == 1
    names = {option.candidate.name for option in options}
    assert {lead for option in options for lead in option.candidate.leads} <= names


@pytest.mark.parametrize(
    ("coarse", "fine"),
    [
        ({"coupling.step_ms": 5}, {"coupling.step_ms": 1}),
        ({"coupling.adaptive.tolerance": 0.1}, {"coupling.adaptive": {"tolerance": 0.02}}),
        ({"scene.mesh_size_mm": 5}, {"scene.mesh_size_mm": 2}),
        ({"scene.refine": 0}, {"scene.refine": 1}),
        ({_SUBSTEP: 1}, {_SUBSTEP: 0.25}),
        ({"units.electrophysiology.parameters.refine": 0}, {"units.electrophysiology.parameters.refine": 1}),
        ({"units.mechanics.every": 2}, {"units.mechanics.every": 1}),
        (
            {"coupling.iterate": {"converge": {"stretch": {"relative": 1e-2}}}},
            {"coupling.iterate": {"converge": {"stretch": {"relative": 1e-4}}}},
        ),
    ],
)
def test_it_is_known_of_a_key_which_way_is_finer(
    small_scenario: Path, coarse: Mapping[str, Any], fine: Mapping[str, Any]
) -> None:
    scenario = load_scenario(small_scenario)
    (one, _), (other, _) = ordered(coarse, scenario), ordered(fine, scenario)
    assert one.keys() == other.keys()
    assert all(one[key] < other[key] for key in one)


def test_nothing_is_said_of_keys_that_change_what_is_computed(small_scenario: Path) -> None:
    settings = {
        "coupling.scheme": "jacobi",
        "units.electrophysiology.parameters.stretch_conductance": 1.0,
        "units.electrophysiology.parameters.mass_matrix": "lumped",
        "run.stop_ms": 100,
    }
    assert ordered(settings, load_scenario(small_scenario)) == ({}, settings)
