"""If this failed, the coupled result would depend on how the units are called, not on the physics they solve."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError, RunError
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario


def _series(scenario: Path, folder: Path, *assignments: str) -> np.ndarray:
    run_scenario(load_scenario(scenario, assignments), scenario.parent, folder)
    return np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_fmus_and_direct_calls_give_the_same_bits(scheme: str, small_scenario: Path, tmp_path: Path) -> None:
    for participants in ("native", "fmu"):
        _series(
            small_scenario,
            tmp_path / participants,
            f"coupling.scheme={scheme}",
            f"run.participants={participants}",
            "run.stop_ms=15",
            # The extension that makes active stress and mechanics a loop takes part as well.
            "units.active_stress.parameters.length_dependence=0.5",
        )
    native, fmu = tmp_path / "native", tmp_path / "fmu"
    assert (native / "timeseries.csv").read_bytes() == (fmu / "timeseries.csv").read_bytes()
    with h5py.File(native / "fields.h5") as one, h5py.File(fmu / "fields.h5") as other:
        names: list[str] = []
        one.visit(names.append)
        assert "frames/stretch" in names
        for name in names:
            if isinstance(one[name], h5py.Dataset):
                assert np.array_equal(one[name][...], other[name][...]), name


def test_jacobi_and_gauss_seidel_converge_to_one_limit_at_first_order(small_scenario: Path, tmp_path: Path) -> None:
    steps = (2.0, 1.0, 0.5, 0.25)
    volumes = {}
    for scheme in ("jacobi", "gauss-seidel"):
        volumes[scheme] = np.array(
            [
                _series(
                    small_scenario,
                    tmp_path / f"{scheme}-{step}",
                    f"coupling.scheme={scheme}",
                    f"coupling.step_ms={step}",
                    "run.stop_ms=24",
                    "output.every_ms=24",
                    # The delay of the active stress switches within 1 mV of an upstroke of 100: a jump at any step
                    # there is. Spread over 20 mV it leaves the order of the coupling to be seen.
                    "units.active_stress.parameters.delay_slope_per_mV=0.05",
                )["lv_volume_ml"][-1]
                for step in steps
            ]
        )
    differences = {scheme: np.diff(values) for scheme, values in volumes.items()}
    for scheme, change in differences.items():
        orders = np.log2(np.abs(change[:-1] / change[1:]))
        assert orders[-1] == pytest.approx(1.0, abs=0.1), (scheme, orders, volumes)
    limits = {scheme: 2.0 * values[-1] - values[-2] for scheme, values in volumes.items()}
    gap = abs(limits["jacobi"] - limits["gauss-seidel"])
    assert gap < 0.03 * abs(volumes["jacobi"][-1] - volumes["gauss-seidel"][-1])


def test_the_order_of_the_units_makes_no_difference_under_jacobi(small_scenario: Path, tmp_path: Path) -> None:
    orders = ("[electrophysiology, active_stress, mechanics]", "[mechanics, electrophysiology, active_stress]")
    one, other = (
        _series(small_scenario, tmp_path / str(k), "coupling.scheme=jacobi", f"coupling.order={order}")
        for k, order in enumerate(orders)
    )
    assert np.array_equal(one, other)


def test_the_order_of_the_units_matters_under_gauss_seidel(small_scenario: Path, tmp_path: Path) -> None:
    orders = ("[electrophysiology, active_stress, mechanics]", "[mechanics, active_stress, electrophysiology]")
    one, other = (
        _series(small_scenario, tmp_path / str(k), f"coupling.order={order}") for k, order in enumerate(orders)
    )
    # The second order is Jacobi's lag in disguise: the volume follows later.
    assert other["lv_volume_ml"][-1] > one["lv_volume_ml"][-1]


def _iterated(acceleration: str, tolerance: float = 1e-6) -> str:
    return (
        f"coupling.iterate={{acceleration: {acceleration}, max_iterations: 60, "
        f"converge: {{stretch: {{relative: {tolerance}}}, potential: {{relative: {tolerance}}}, "
        f"active_stress: {{relative: {tolerance}, absolute: 1e-6}}}}}}"
    )


def test_iterated_jacobi_and_iterated_gauss_seidel_find_the_same_solution(small_scenario: Path, tmp_path: Path) -> None:
    common = ("coupling.step_ms=5", "run.stop_ms=40", "output.every_ms=40", _iterated("none"))
    one = _series(small_scenario, tmp_path / "gauss-seidel", "coupling.scheme=gauss-seidel", *common)
    other = _series(small_scenario, tmp_path / "jacobi", "coupling.scheme=jacobi", *common)
    explicit = _series(small_scenario, tmp_path / "explicit", *common[:3])
    for column in ("lv_volume_ml", "apex_uplift_mm", "potential_base_mV"):
        np.testing.assert_allclose(one[column], other[column], rtol=2e-5, atol=1e-4)
    # It is not what one sweep gives.
    assert np.abs(one["lv_volume_ml"] - explicit["lv_volume_ml"]).max() > 1e-3


def test_iterated_coupling_by_fmu_states_gives_the_same_bits(small_scenario: Path, tmp_path: Path) -> None:
    for participants in ("native", "fmu"):
        _series(
            small_scenario,
            tmp_path / participants,
            f"run.participants={participants}",
            "coupling.step_ms=5",
            _iterated("anderson"),
        )
    native, fmu = tmp_path / "native", tmp_path / "fmu"
    assert (native / "timeseries.csv").read_bytes() == (fmu / "timeseries.csv").read_bytes()
    log = np.genfromtxt(fmu / "coupling.csv", delimiter=",", names=True)
    assert (log["iterations"] > 1).all()
    assert (log["residual_mechanicsstretch"] > 0).all()
    assert ((log["contraction_rate"] > 0) & (log["contraction_rate"] < 1)).all()


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_anderson_never_needs_more_sweeps_than_the_plain_iteration(
    scheme: str, small_scenario: Path, tmp_path: Path
) -> None:
    sweeps = {}
    for acceleration in ("none", "anderson"):
        _series(
            small_scenario,
            tmp_path / acceleration,
            f"coupling.scheme={scheme}",
            "coupling.step_ms=5",
            "run.stop_ms=40",
            "output.every_ms=40",
            _iterated(acceleration),
        )
        log = np.genfromtxt(tmp_path / acceleration / "coupling.csv", delimiter=",", names=True)
        sweeps[acceleration] = log["iterations"]
    assert (sweeps["anderson"] <= sweeps["none"]).all(), sweeps
    assert sweeps["anderson"].sum() < sweeps["none"].sum()


def test_a_step_repeated_from_a_saved_state_leaves_no_trace(small_scenario: Path, tmp_path: Path) -> None:
    # A criterion that the second sweep meets: every step is taken twice from its begin, with the inputs of a step that
    # nothing changes. Without feedback the second sweep sees what the first one saw.
    # Of exactly zero the master knows that there is no loop.
    common = ("units.electrophysiology.parameters.stretch_conductance=1e-300", "coupling.step_ms=2.5")
    once = _series(small_scenario, tmp_path / "once", *common)
    twice = _series(small_scenario, tmp_path / "twice", *common, _iterated("none", 1e-12))
    log = np.genfromtxt(tmp_path / "twice" / "coupling.csv", delimiter=",", names=True)
    assert (log["iterations"] >= 2).all()
    assert np.array_equal(once, twice)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        (
            "{converge: {strech: {relative: 1e-4}}}",
            "'strech' is not a connected output; did you mean 'mechanics.stretch'",
        ),
        ("{converge: {fiber: {relative: 1e-4}}}", "fibers.fiber is exchanged in no loop"),
        ("{converge: {stretch: {}}}", "give a limit: `relative`, `absolute` or `residual-relative`"),
        ("{converge: {stretch: {relativ: 1e-4}}}", "did you mean 'relative'"),
        ("{converge: {}}", "converge"),
        ("{acceleration: andersen, converge: {stretch: {relative: 1e-4}}}", "did you mean 'anderson'"),
        ("{max_iteration: 3, converge: {stretch: {relative: 1e-4}}}", "did you mean 'max_iterations'"),
    ],
)
def test_a_wrong_iteration_is_explained(setting: str, words: str, small_scenario: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        run_scenario(
            load_scenario(small_scenario, [f"coupling.iterate={setting}"]), small_scenario.parent, tmp_path / "out"
        )
    assert not (tmp_path / "out" / "timeseries.csv").exists()


def test_an_iteration_that_does_not_converge_says_where(small_scenario: Path, tmp_path: Path) -> None:
    setting = "coupling.iterate={max_iterations: 2, converge: {stretch: {relative: 1e-12}}}"
    with pytest.raises(RunError, match=r"no convergence in 2 sweeps: mechanics\.stretch \(largest at element \d+:"):
        _series(small_scenario, tmp_path / "out", setting)
    assert (tmp_path / "out" / "summary.json").is_file()
    tolerant = setting.replace("max_iterations: 2", "max_iterations: 2, on_limit: warn")
    _series(small_scenario, tmp_path / "warned", tolerant)
    summary = json.loads((tmp_path / "warned" / "summary.json").read_text())
    # The first step may be too quiet to miss even this criterion.
    assert summary["status"] == "done"
    assert len(summary["unconverged_ms"]) >= 8


# --- ramped inputs and adaptive steps on the whole heart ----------------------------------------------------------


def _baseline(out: Path, *sets: str) -> tuple[np.ndarray, np.ndarray]:
    base = Path(__file__).parents[1] / "scenarios" / "baseline.yaml"
    scenario = load_scenario(base, ["run.participants=native", "run.checkpoint_every=0", *sets])
    run_scenario(scenario, base.parent, out)
    return (
        np.genfromtxt(out / "timeseries.csv", delimiter=",", names=True),
        np.genfromtxt(out / "coupling.csv", delimiter=",", names=True),
    )


def _apart(series: np.ndarray, finest: np.ndarray) -> float:
    """Largest difference of the left ventricle's volume in ml."""
    return float(
        np.abs(series["lv_volume_ml"] - np.interp(series["time_ms"], finest["time_ms"], finest["lv_volume_ml"])).max()
    )


_HELD = ("coupling.interpolation=hold", "coupling.extrapolation=0", "output.every_ms=20")
_LINEAR = ("coupling.interpolation=linear", "coupling.extrapolation=1", "output.every_ms=10")


@pytest.mark.long
def test_a_heartbeat_in_steps_of_5_ms_and_in_adaptive_ones(tmp_path: Path) -> None:
    finest, _ = _baseline(tmp_path / "finest", "coupling.step_ms=0.1", *_HELD)
    held, _ = _baseline(tmp_path / "held", *_HELD)
    errors, sweeps = {}, {}
    for acceleration in ("none", "anderson"):
        for step in (10.0, 5.0, 2.5, 1.25):
            iterate = f"coupling.iterate={{acceleration: {acceleration}, converge: {{stretch: {{relative: 1e-5}}}}}}"
            series, log = _baseline(tmp_path / f"{acceleration}{step}", *_LINEAR, iterate, f"coupling.step_ms={step}")
            errors[acceleration, step] = _apart(series, finest)
            sweeps[acceleration, step] = log["iterations"]
    assert errors["anderson", 5.0] < 0.1
    assert sweeps["anderson", 5.0].mean() < 4.0
    for step in (10.0, 5.0, 2.5, 1.25):
        assert (sweeps["anderson", step] <= sweeps["none", step]).all(), step
    series, log = _baseline(tmp_path / "adaptive", "coupling.adaptive={}", "output.every_ms=20")
    attempts = len(log) + int(log["rejected"].sum())
    assert attempts <= 320 / 4, attempts
    assert _apart(series, finest) < _apart(held, finest)
