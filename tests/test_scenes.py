"""If these fail, a scene that comes with the project does not run, or small scenes do not agree with large ones."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

_SCENARIOS = Path(__file__).parent.parent / "scenarios"
#: What is set to see a scene run without waiting for the whole beat.
_SHORT = {
    "baseline": ("run.stop_ms=5",),
    "without_feedback": ("run.stop_ms=20",),
    "return_to_rest": ("run.stop_ms=10",),
    "activation_map": ("run.stop_ms=50",),
    "arrival_times": ("run.stop_ms=20",),
    "left_ventricle": ("run.stop_ms=20", "scene.mesh_size_mm=12"),
}
#: What the columns are called that a scene is there for, where it is not the potential.
_WATCHED = {"inflation": "lv_pressure_", "oscillator": "first", "feedback": "forth"}
_TIME_SCALE_MS = 12.9


def _run(name: str, out: Path, *sets: str) -> tuple[np.ndarray, dict[str, Any]]:
    scenario = load_scenario(_SCENARIOS / f"{name}.yaml", ["run.participants=native", *sets])
    outcome = run_scenario(scenario, _SCENARIOS, out / name)
    return np.genfromtxt(out / name / "timeseries.csv", delimiter=",", names=True), outcome.summary


@pytest.mark.parametrize("name", sorted(path.stem for path in _SCENARIOS.glob("*.yaml")))
def test_every_scene_runs_and_says_what_one_learns(name: str, tmp_path: Path) -> None:
    text = (_SCENARIOS / f"{name}.yaml").read_text(encoding="utf-8")
    assert text.startswith("# ")
    assert name == "baseline" or "What one learns" in text
    series, summary = _run(name, tmp_path, *_SHORT.get(name, ()))
    assert summary["status"] == "done"
    assert len(series) == summary["steps"] + 1
    watched = _WATCHED.get(name, "potential_")
    columns = [column for column in series.dtype.names or () if column.startswith(watched)]
    assert columns
    for column in columns:
        assert np.isfinite(series[column]).all()
    with h5py.File(tmp_path / name / "fields.h5") as file:
        assert file["frames_ms"][-1] == summary["end_ms"]


@pytest.mark.parametrize("name", ["cell", "strand", "sheet", "inflation", "oscillator", "feedback"])
def test_small_scenes_run_through_fmus_with_the_same_bits(name: str, tmp_path: Path) -> None:
    stop = ("run.stop_ms=20",)
    _run(name, tmp_path / "native", *stop)
    _run(name, tmp_path / "fmu", *stop, "run.participants=fmu")
    series = [(tmp_path / kind / name / "timeseries.csv").read_bytes() for kind in ("native", "fmu")]
    assert series[0] == series[1]


# --- the numbers of docs/model.md, computed independently -------------------------------------------------------------


def test_the_cells_action_potential(tmp_path: Path) -> None:
    # beta_t at Z = 0 without reduction is 12.9 ms: APD90 = 31.26 beta_t, peak 19.95 mV.
    series, summary = _run("cell", tmp_path)
    time, potential = series["time_ms"], series["potential_cell_mV"]
    assert potential.max() == pytest.approx(19.95, abs=0.01)
    level = potential.max() - 0.9 * (potential.max() + 80.0)
    end = np.flatnonzero((potential[:-1] > level) & (potential[1:] <= level))[-1]
    crossing = time[end] + (potential[end] - level) / (potential[end] - potential[end + 1])
    assert crossing == pytest.approx(31.26 * _TIME_SCALE_MS, rel=2e-3)
    # A free fibre shortens to 0.736 under half a megapascal.
    with h5py.File(tmp_path / "cell" / "fields.h5") as file:
        stretch = file["frames/stretch"][:, 0]
    assert stretch.min() == pytest.approx(0.7365, abs=1e-3)
    assert stretch[-1] == pytest.approx(1.0, abs=5e-3)
    assert summary["lv_volume_ml"]["max"] == 0.0


@pytest.mark.parametrize(("size", "error"), [(2.0, 0.010), (1.0, 0.002), (0.5, 0.001)])
def test_the_strands_speed_and_what_its_elements_do_to_it(size: float, error: float, tmp_path: Path) -> None:
    # 0.5717 mm/ms at d = 1.1; consistent mass with nodal currents +0.2 % at 1 mm, +1.0 % at 2 mm.
    _, summary = _run(
        "strand",
        tmp_path,
        f"scene.mesh_size_mm={size}",
        "run.stop_ms=100",
        "units.electrophysiology.parameters.stretch_conductance=0",
        "units.electrophysiology.parameters.longest_substep_ms=0.0625",
    )
    times = summary["activation_time_ms"]
    assert 20.0 / (times["far"] - times["near"]) == pytest.approx(0.5717 * (1.0 + error), rel=3e-3)


def test_the_sheets_wave_is_faster_along_the_fibres(tmp_path: Path) -> None:
    _, summary = _run("sheet", tmp_path)
    # At equal distances, which is what its plot shows: the speed of a plane wave is 0.5717 mm/ms along the fibres and
    # by the square root of 1.1 less across; a front that is curved outward is slower than a plane one.
    times = summary["activation_time_ms"]
    speeds = {way: 8.0 / (times[f"{way}_far"] - times[f"{way}_near"]) for way in ("along", "across")}
    assert times["along_near"] < times["across_near"] - 0.5
    assert times["along_far"] < times["across_far"] - 1.0
    assert speeds["along"] / speeds["across"] == pytest.approx(np.sqrt(1.1), rel=0.01)
    for way, plane in (("along", 0.5717), ("across", 0.5717 / np.sqrt(1.1))):
        assert 0.9 * plane < speeds[way] < plane, way
    with h5py.File(tmp_path / "sheet" / "fields.h5") as file:
        points, activation = file["points_mm"][:], file["frames/activation_time_ms"][-1]

    def slope(axis: int, places: np.ndarray) -> float:
        chosen = places & (activation > 0.0)
        return float(np.polyfit(activation[chosen], points[chosen, axis], 1)[0])

    along = slope(0, (np.abs(points[:, 1]) < 1.0) & (points[:, 0] > 25.0) & (points[:, 0] < 50.0))
    across = slope(1, (points[:, 0] < 1.0) & (points[:, 1] > 15.0) & (points[:, 1] < 25.0))
    assert along / across == pytest.approx(np.sqrt(1.1), rel=0.05)


def test_the_sheets_probes_are_equally_far_from_the_stimulated_place() -> None:
    scenario = load_scenario(_SCENARIOS / "sheet.yaml")
    box = scenario.units["electrophysiology"].parameters
    probes = {name: np.array(place) for name, place in scenario.output.probes_mm.items()}
    for which in ("near", "far"):
        along, across = probes[f"along_{which}"], probes[f"across_{which}"]
        # Across at the left edge, which mirrors the wave as the axis does along the fibres.
        assert along[1] == across[0] == 0.0
        assert along[0] - box["stimulus_x_max_mm"] == across[1] - box["stimulus_half_width_mm"] > 5.0


def test_the_left_ventricle_twists_and_shortens_until_its_greatest_contraction(tmp_path: Path) -> None:
    series, summary = _run("left_ventricle", tmp_path, "scene.mesh_size_mm=12")
    end = int(series["lv_volume_ml"].argmin())
    assert 0.0 < series["time_ms"][end] < 0.75 * summary["end_ms"]
    # Wrung out counterclockwise as seen from its apex, as a healthy heart is; the run begins at rest.
    assert 5.0 < series["twist_deg"][end] < 10.0
    assert summary["twist_deg"]["max"] < 1.02 * series["twist_deg"][end]
    assert -0.2 < series["circumferential_strain"][end] < -0.1
    assert -0.1 < series["longitudinal_strain"][end] < -0.03
    assert series["twist_deg"][0] == series["radial_strain"][0] == 0.0
    # A slab of the same tissue has neither.
    slab, _ = _run("slab", tmp_path, "run.stop_ms=2")
    assert "twist_deg" not in (slab.dtype.names or ())


def test_the_pressure_volume_curve_of_the_resting_ventricle(tmp_path: Path) -> None:
    series, summary = _run("inflation", tmp_path)
    pressure, volume = series["lv_pressure_kPa"], series["lv_volume_ml"]
    np.testing.assert_allclose(pressure, np.linspace(0.0, 3.0, 21), atol=1e-12)
    assert (np.diff(volume) > 0.0).all()
    # By two thirds and more at 2 kPa; stiffer at the end than half of the way.
    assert volume[0] == pytest.approx(37.8, abs=0.1)
    assert 1.6 < np.interp(2.0, pressure, volume) / volume[0] < 1.9
    compliance = np.diff(volume) / np.diff(pressure)
    assert compliance[-1] < 0.7 * compliance.max()
    assert summary["lv_pressure_kPa"]["max"] == 3.0
    # Linear elements of the same size resist more: locking makes a heart that cannot be filled.
    linear, _ = _run("inflation", tmp_path / "linear", "units.mechanics.parameters.element_order=1")
    assert np.interp(1.0, pressure, linear["lv_volume_ml"]) < np.interp(1.0, pressure, volume) - 1.0


def test_the_oscillators_error_falls_with_the_step_until_it_is_unstable(tmp_path: Path) -> None:
    # Limits as the scene's text has them: 0.078 s with held inputs, 0.318 s with linear ones, none by displacements.
    linear = ("coupling.interpolation=linear", "coupling.extrapolation=1")
    places = "first.x -> second.x_in, first.v -> second.v_in, second.x -> first.x_in, second.v -> first.v_in"
    displacements = (f"connections=[{places}]", "units.first.parameters={k: 10, c: 0.2, k_c: 10, c_c: 0.5, x_start: 1}")
    for sets, step_ms, stable in (
        ((), 75, True), ((), 81, False), (linear, 310, True), (linear, 326, False), (displacements, 1000, True)
    ):  # fmt: skip
        every = (f"coupling.step_ms={step_ms}", f"run.stop_ms={300 * step_ms}", f"output.every_ms={300 * step_ms}")
        series, _ = _run("oscillator", tmp_path / f"{len(sets)}-{step_ms}", *sets, *every)
        assert (np.abs(series["firstx"][-20:]).max() < np.abs(series["firstx"][100:120]).max()) == stable


@pytest.mark.parametrize("step_ms", [0.1, 1.0, 8.0])
def test_a_loops_gain_decides_and_not_the_step_until_it_is_iterated(step_ms: float, tmp_path: Path) -> None:
    short = (f"coupling.step_ms={step_ms}", f"run.stop_ms={40 * step_ms}", f"output.every_ms={40 * step_ms}")
    for gain in (-0.9, -1.1):
        chosen = (*short, f"units.back.parameters.gain={gain}")
        series, _ = _run("feedback", tmp_path / str(gain), *chosen)
        assert series["forthy"][-1] == pytest.approx(gain**40, rel=1e-9)
        iterated = "coupling.iterate={acceleration: anderson, converge: {forth.y: {absolute: 1e-9}}}"
        series, _ = _run("feedback", tmp_path / f"{gain}-iterated", *chosen, iterated)
        assert abs(series["forthy"][-1]) < 1e-8


# --- scenes that are one another's limits -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["strand", "sheet"])
def test_identical_cells_in_a_row_are_one_cell(name: str, tmp_path: Path) -> None:
    everywhere = ("stimulus_x_min_mm=-1", "stimulus_x_max_mm=100", "stimulus_half_width_mm=100")
    sets = [f"units.electrophysiology.parameters.{setting}" for setting in everywhere]
    common = ("run.stop_ms=50", "coupling.step_ms=5", "output.every_ms=5")
    cell, _ = _run("cell", tmp_path, *common)
    many, _ = _run(name, tmp_path, *common, "scene.mesh_size_mm=6", *sets)
    columns = [column for column in many.dtype.names or () if column.startswith("potential_")]
    assert len(columns) == {"strand": 2, "sheet": 4}[name]
    for column in columns:
        np.testing.assert_allclose(many[column], cell["potential_cell_mV"], atol=1e-6)


def test_a_slab_with_a_plane_wave_is_a_strand(tmp_path: Path) -> None:
    # Horizontal fibres across the way of the wave: d = 1 in both.
    parameters = "units.electrophysiology.parameters."
    flat = [f"units.fibers.parameters.{side}_angle_deg=0" for side in ("endocardial", "epicardial")]
    quiet = (f"{parameters}stretch_conductance=0", "coupling.step_ms=5", "output.every_ms=10", "run.stop_ms=80")
    _, slab = _run(
        "slab", tmp_path, *quiet, *flat, "scene.mesh_size_mm=2",
        "output.probes_mm={upper: [15, 0, -10], lower: [15, 0, -24]}", "units.mechanics.unit=local_mechanics",
    )  # fmt: skip
    _, strand = _run(
        "strand", tmp_path, *quiet, f"{parameters}diffusion_anisotropic_mm2_per_ms=0", "scene.mesh_size_mm=2",
        "output.probes_mm={upper: [10, 0, 0], lower: [24, 0, 0]}", f"{parameters}stimulus_x_max_mm=3",
    )  # fmt: skip
    took = [times["lower"] - times["upper"] for times in (slab["activation_time_ms"], strand["activation_time_ms"])]
    assert took[0] == pytest.approx(took[1], rel=0.01)


def test_without_feedback_mechanics_is_solved_at_outputs_only_and_to_the_same_end(tmp_path: Path) -> None:
    text = json.loads(json.dumps({"small": "biventricle_12mm.msh"}))
    sets = (
        f"scene={{mesh: {text['small']}}}",
        "units.electrophysiology.parameters={stimulus_depth_mm: 5, stretch_conductance: 0}",
        "run={stop_ms: 20, participants: native}",
        "output={every_ms: 10}",
    )
    base = Path(__file__).parent / "data"
    lazy = run_scenario(load_scenario(_SCENARIOS / "without_feedback.yaml", sets), base, tmp_path / "lazy")
    always = (*sets, "output={every_ms: 1}")
    eager = run_scenario(load_scenario(_SCENARIOS / "without_feedback.yaml", always), base, tmp_path / "eager")
    rows = [np.genfromtxt(outcome.folder / "timeseries.csv", delimiter=",", names=True) for outcome in (lazy, eager)]
    solved = np.flatnonzero(np.isfinite(rows[0]["lv_volume_ml"]))
    assert solved.tolist() == [0, 10, 20]
    assert np.isfinite(rows[1]["lv_volume_ml"]).all()
    np.testing.assert_allclose(rows[0]["lv_volume_ml"][solved], rows[1]["lv_volume_ml"][solved], rtol=1e-9)
    profile = json.loads((lazy.folder / "profile.json").read_text())
    row = next(event["tid"] for event in profile if event.get("args", {}).get("name") == "mechanics")
    steps = [event for event in profile if event["ph"] == "X" and event["tid"] == row and event["name"] == "step"]
    assert len(steps) == 2
    # Its loop is open: there is nothing to iterate.
    assert lazy.summary["lv_volume_ml"]["end"] == rows[0]["lv_volume_ml"][-1]
