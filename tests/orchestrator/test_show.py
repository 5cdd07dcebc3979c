"""If these fail, `cosim show` tells a person something else than what `cosim run` does."""

from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.run import run_scenario, show_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mesh import Mesh


def _show(path: Path, *sets: str) -> dict[str, list[str]]:
    """The lines of each part by its title."""
    name, *parts = show_scenario(load_scenario(path, sets), path.parent).split("\n\n")
    assert name == "small"
    return {part.split("\n")[0]: [line.strip() for line in part.split("\n")[1:]] for part in parts}


def test_mesh_units_connections_loop_and_order(small_scenario: Path, small_heart: Mesh) -> None:
    shown = _show(small_scenario)
    assert shown["mesh"][0] == f"{small_heart.nodes} nodes, {small_heart.elements} tetrahedra"
    assert any(line.startswith("volume ") and "SICN" in line for line in shown["mesh"])
    assert "boundary base: " in " ".join(shown["mesh"])
    assert f"in  active_stress kPa, {small_heart.nodes}" in shown["units"]
    assert f"out fiber, {small_heart.elements} × 3 (once)" in shown["units"]
    assert "mechanics.stretch -> electrophysiology.stretch" in shown["connections"]
    assert "fibers.fiber -> mechanics.fiber (once)" in shown["connections"]
    assert shown["loops"] == ["electrophysiology <-> active_stress <-> mechanics"]
    assert shown["order"] == ["electrophysiology -> active_stress -> mechanics"]
    # Potential and active stress at the nodes, stretch in the elements.
    numbers = 2 * small_heart.nodes + small_heart.elements
    assert shown["exchange"][0] == f"{numbers} numbers in 3 fields at every exchange"
    assert "mechanics: 10 solves" in shown["exchange"]


def test_every_field_that_has_to_converge_is_named_with_its_criterion(small_scenario: Path) -> None:
    iterate = "coupling.iterate={converge: {stretch: {relative: 1e-4, absolute: 1e-6}}}"
    named = "mechanics.stretch: absolute 1e-06 or relative 0.0001"
    # Under Gauss–Seidel the others are computed from the stretch in the same sweep.
    assert _show(small_scenario, iterate)["convergence"] == [named]
    jacobi = _show(small_scenario, iterate, "coupling.scheme=jacobi")["convergence"]
    assert jacobi[0] == named
    assert [line.partition(":")[0] for line in jacobi[1:]] == [
        "electrophysiology.potential",
        "active_stress.active_stress",
    ]
    assert all("has to meet the strictest given criterion" in line for line in jacobi[1:])
    assert "convergence" not in _show(small_scenario)


def test_what_is_not_modelled_is_named_with_the_reason_and_what_it_saves(small_scenario: Path, tmp_path: Path) -> None:
    quiet = "units.electrophysiology.parameters={stimulus_depth_mm: 5, stretch_conductance: 0}"
    shown = _show(small_scenario, quiet)
    assert "electrophysiology.stretch: stretch_conductance of the unit is 0" in " ".join(shown["not modelled"])
    assert shown["loops"] == ["none: one ordered sweep is exact, there is nothing to iterate"]
    assert "mechanics: 2 solves, 8 fewer than exchanges; nothing is fed by it between outputs" in shown["exchange"]
    # And that is what is done.
    out = run_scenario(load_scenario(small_scenario, [quiet]), tmp_path, tmp_path / "out").folder
    log = np.genfromtxt(out / "coupling.csv", delimiter=",", names=True)
    assert np.count_nonzero(log["seconds_mechanics"]) == 2
    assert np.count_nonzero(log["seconds_electrophysiology"]) == 10


def test_what_stabilises_a_loop_is_exchanged_where_there_is_one(small_scenario: Path, small_heart: Mesh) -> None:
    shown = _show(small_scenario)
    missing = "mechanics.{}: length_dependence of active_stress, which gives it, is 0, so it keeps its start value"
    for name in ("active_stiffness", "reference_stretch"):
        assert missing.format(name) in shown["not modelled"]
    looped = _show(small_scenario, "units.active_stress.parameters.length_dependence=2")
    assert "active_stress.active_stiffness -> mechanics.active_stiffness" in looped["connections"]
    # Beside potential, active stress and the stretch, which two units want.
    numbers = 3 * small_heart.nodes + 3 * small_heart.elements
    assert looped["exchange"][0] == f"{numbers} numbers in 6 fields at every exchange"
    plain = _show(
        small_scenario,
        "units.active_stress.parameters.length_dependence=2",
        "units.mechanics.parameters.stabilization=0",
    )
    assert "mechanics.active_stiffness: stabilization of the unit is 0" in " ".join(plain["not modelled"])
    assert plain["exchange"][0].endswith("in 4 fields at every exchange")


def test_an_input_that_nobody_feeds_is_named(small_scenario: Path, tmp_path: Path) -> None:
    text = small_scenario.read_text().replace("  mechanics: {unit: mechanics}\n", "")
    (tmp_path / "small2.yaml").write_text(text)
    shown = _show(tmp_path / "small2.yaml")
    assert "electrophysiology.stretch: no unit gives it, so it keeps its start value" in shown["not modelled"]


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ([], ["elements of 11", "coarse against a depolarising front of 7.9 mm"]),
        (["coupling.step_ms=20", "run.stop_ms=40", "output.every_ms=20"], ["longer than an upstroke"]),
    ],
)
def test_warnings(sets: list[str], words: list[str], small_scenario: Path) -> None:
    warnings = " ".join(_show(small_scenario, *sets)["warnings"])
    for word in words:
        assert word in warnings, warnings


def test_adaptive_steps_and_units_that_step_less_often(small_scenario: Path) -> None:
    assert "steps of 0.5 to 20 ms, as needed" in _show(small_scenario, "coupling.adaptive={}")["exchange"]
    shown = _show(small_scenario, "units.mechanics.every=4")
    assert any(line.startswith("mechanics: 3 solves, 7 fewer") for line in shown["exchange"])


def test_what_is_wrong_is_told_as_by_run(small_scenario: Path) -> None:
    with pytest.raises(InputError, match=r"coupling\.iterate"):
        _show(small_scenario, "coupling.iterate={converge: {strech: {relative: 1e-4}}}")


def test_a_scene_without_a_mesh_to_speak_of(cosim) -> None:
    ended = cosim("show", Path(__file__).parents[2] / "scenarios" / "cell.yaml")
    assert ended.code == 0
    assert "1 nodes, 1 points" in ended.out
    assert "3 numbers in 3 fields at every exchange" in ended.out
