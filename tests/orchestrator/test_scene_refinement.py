"""If these fail, `scene.refine` changes what is computed, not only how finely; or a step on the way forgets it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mesh import Mesh

_SCENARIOS = Path(__file__).parents[2] / "scenarios"
_WAVE = "units.electrophysiology.parameters."
#: The same fibre everywhere, so that parts of an element have what it has, and no feedback.
_QUIET = (
    "run.participants=native",
    f"{_WAVE}stretch_conductance=0",
    "units.fibers.parameters={endocardial_angle_deg: 0, epicardial_angle_deg: 0}",
)


def _run(path: Path, out: Path, *sets: str, resume: bool = False) -> dict[str, Any]:
    return run_scenario(load_scenario(path, sets), path.parent, out, resume=resume).summary


def _last(out: Path, name: str) -> np.ndarray:
    with h5py.File(out / "fields.h5") as file:
        return np.asarray(file[f"frames/{name}"][-1])


@pytest.mark.parametrize(("name", "size", "stop"), [("strand", 4.0, 60), ("sheet", 5.0, 60), ("slab", 8.0, 30)])
def test_a_wave_on_the_refined_scene_is_the_wave_of_a_unit_that_refines_inside(
    name: str, size: float, stop: int, tmp_path: Path
) -> None:
    path = _SCENARIOS / f"{name}.yaml"
    common = (*_QUIET, f"scene.mesh_size_mm={size}", f"run.stop_ms={stop}")
    _run(path, tmp_path / "inside", *common, f"{_WAVE}refine=1")
    _run(path, tmp_path / "scene", *common, "scene.refine=1")
    inside, scene = (_last(tmp_path / where, "activation_time_ms") for where in ("inside", "scene"))
    assert len(scene) > len(inside)
    assert np.count_nonzero(inside > 0.0) > len(inside) // 4
    # The first nodes are those of the coarse mesh.
    np.testing.assert_allclose(scene[: len(inside)], inside, rtol=1e-9)


def test_a_refined_mesh_file_is_the_same_heart_of_eight_times_the_elements(
    small_scenario: Path, small_heart: Mesh, tmp_path: Path
) -> None:
    coarse = _run(small_scenario, tmp_path / "coarse", "run.stop_ms=5")
    fine = _run(small_scenario, tmp_path / "fine", "run.stop_ms=5", "scene.refine=1")
    assert _last(tmp_path / "fine", "stretch").shape == (8 * small_heart.elements,)
    for cavity in ("lv_volume_ml", "rv_volume_ml"):
        assert fine[cavity]["start"] == pytest.approx(coarse[cavity]["start"], rel=1e-12)
    assert fine["warnings"] == coarse["warnings"]
    assert fine["scenario"]["scene"]["refine"] == 1
    (small_scenario.parent / "again.yaml").write_text(json.dumps(fine["scenario"]))
    again = load_scenario(small_scenario.parent / "again.yaml")
    assert again.resolved() == fine["scenario"]


def test_an_interrupted_run_on_a_refined_scene_goes_on_to_the_same_bits(
    small_scenario: Path, stopped: Callable[..., None], tmp_path: Path
) -> None:
    sets = ("run.stop_ms=8", "output.every_ms=4", "run.checkpoint_every=2", "scene.refine=1")
    scenario = load_scenario(small_scenario, sets)
    stopped(5, scenario, small_scenario.parent, tmp_path / "resumed")
    _run(small_scenario, tmp_path / "resumed", *sets, resume=True)
    _run(small_scenario, tmp_path / "whole", *sets)
    series = [(tmp_path / which / "timeseries.csv").read_bytes() for which in ("resumed", "whole")]
    assert series[0] == series[1]
    assert np.array_equal(_last(tmp_path / "resumed", "potential_mV"), _last(tmp_path / "whole", "potential_mV"))


def test_single_cells_are_not_refined(tmp_path: Path) -> None:
    for levels in (0, 6):
        sets = ("run.participants=native", "run.stop_ms=20", f"scene.refine={levels}")
        _run(_SCENARIOS / "cell.yaml", tmp_path / str(levels), *sets)
    series = [(tmp_path / str(levels) / "timeseries.csv").read_bytes() for levels in (0, 6)]
    assert series[0] == series[1]


def test_fmus_and_packages_have_the_refined_mesh_once(cosim: Callable[..., Any], tmp_path: Path) -> None:
    sets = ("scene.mesh_size_mm=6", "run.stop_ms=10", "scene.refine=1")
    options = [word for setting in sets for word in ("--set", setting)]
    built = tmp_path / "built"
    path = _SCENARIOS / "strand.yaml"
    assert cosim("build", path, *options, "--ssp", "--output", built).code == 0
    packed = cosim("show", built / "strand.ssp")
    shown = cosim("show", path, *options)
    assert "21 nodes, 20 lines" in shown.out
    assert "nested refinement of 10 lines, 1 level\n" in shown.out
    assert "21 nodes, 20 lines" in packed.out
    for participants in ("native", "fmu"):
        _run(path, tmp_path / participants, *sets, f"run.participants={participants}")
    series = [(tmp_path / kind / "timeseries.csv").read_bytes() for kind in ("native", "fmu")]
    assert series[0] == series[1]


@pytest.mark.parametrize(
    ("levels", "words"),
    [
        ("5", ["scene: `refine` is 5", "elements of 845", "take fewer levels"]),
        ("7", ["'scene.refine' is 7", "less than or equal to 6"]),
        ("-1", ["'scene.refine' is -1", "greater than or equal to 0"]),
        ("1.5", ["'scene.refine' is 1.5"]),
    ],
)
def test_levels_that_nobody_could_mean_are_refused(
    levels: str, words: list[str], cosim: Callable[..., Any], small_scenario: Path
) -> None:
    for command in (["show"], ["run", "--output", small_scenario.parent / "out"]):
        ended = cosim(command[0], small_scenario, *command[1:], "--set", f"scene.refine={levels}")
        assert ended.code == 2
        for word in words:
            assert word in ended.err, ended.err


def test_a_coarse_scene_is_told_the_setting_to_compare_with(cosim: Callable[..., Any], small_scenario: Path) -> None:
    assert "compare with scene.refine: 1\n" in cosim("show", small_scenario).out
    assert "compare with scene.refine: 2\n" in cosim("show", small_scenario, "--set", "scene.refine=1").out
