"""If these fail, active stress that depends on the stretch breaks explicit coupling, or its remedy changes the answer.

The loop's gain in a single cell passes −1 at a length dependence of about 3.9, whatever the step.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import RunError
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

_CELL = Path(__file__).parents[1] / "scenarios" / "cell.yaml"

_COMMON = (
    "run.participants=native",
    "run.stop_ms=24",
    "output.every_ms=24",
    # The delay of the active stress switches within 1 mV: spread out, it leaves the order of the coupling to be seen.
    "units.active_stress.parameters.delay_slope_per_mV=0.05",
)
_ITERATED = (
    "coupling.iterate={acceleration: anderson, max_iterations: 60, converge: {stretch: {relative: 1e-11}, "
    "active_stress: {relative: 1e-10, absolute: 1e-8}, potential: {relative: 1e-9}}}"
)
_LINEAR = ("coupling.interpolation=linear", "coupling.extrapolation=1")
_JACOBI = ("coupling.scheme=jacobi",)
_HELD: tuple[str, ...] = ()
#: A stimulus everywhere: all tissue contracts at once, with the largest gain.
_AWAKE = (
    "units.electrophysiology.parameters={stimulus_x_min_mm: -99, stimulus_half_width_mm: 99, stimulus_depth_mm: 99}"
)


def _eta(value: float) -> str:
    return f"units.active_stress.parameters.length_dependence={value}"


def _share(value: float) -> str:
    return f"units.mechanics.parameters.stabilization={value}"


def _run(scenario: Path, folder: Path, *sets: str) -> dict[str, np.ndarray]:
    run_scenario(load_scenario(scenario, sets), scenario.parent, folder)
    return {
        name: np.genfromtxt(folder / f"{name}.csv", delimiter=",", names=True) for name in ("timeseries", "coupling")
    }


def _stress(folder: Path, *sets: str) -> np.ndarray:
    return np.asarray(_run(_CELL, folder, *_COMMON, *sets)["timeseries"]["active_stress_mean_kPa"])


@pytest.mark.parametrize("step", [1.0, pytest.param(0.25, marks=pytest.mark.long)])
@pytest.mark.parametrize("scheme", [_HELD, _JACOBI], ids=["gauss-seidel", "jacobi"])
def test_explicit_coupling_fails_beyond_a_gain_of_one_and_holds_stabilised(
    scheme: tuple[str, ...], step: float, tmp_path: Path
) -> None:
    size = f"coupling.step_ms={step}"
    # Inside of the boundary it holds by itself. The potential has its peak, and with it the gain, at the end.
    inside = _stress(tmp_path / "inside", _eta(3.0), _share(0.0), size, *scheme)
    assert np.isfinite(inside).all()
    with pytest.raises(RunError, match="length_dependence 5 makes the active stress negative"):
        _stress(tmp_path / "outside", _eta(5.0), _share(0.0), size, *scheme)
    stabilised = _stress(tmp_path / "stabilised", _eta(5.0), size, *scheme)
    iterated = _stress(tmp_path / "iterated", _eta(5.0), size, _ITERATED)
    np.testing.assert_allclose(stabilised[-5:], iterated[-5:], rtol=1e-3)


def test_half_of_the_stiffness_is_enough_where_the_formula_says_so(tmp_path: Path) -> None:
    # |g (1 − w)/(1 − w g)| < 1 for w > (1 + g)/(2 g): 0.13 at the g of −1.36 that the cell has here.
    steps = ("coupling.step_ms=1", "run.stop_ms=60", "output.every_ms=60")
    assert np.isfinite(_stress(tmp_path / "enough", _eta(5.0), _share(0.2), *steps)).all()
    with pytest.raises(RunError, match="makes the active stress negative"):
        _stress(tmp_path / "little", _eta(5.0), _share(0.05), *steps)


@pytest.mark.parametrize(
    ("inputs", "order", "steps"),
    [
        (_HELD, 1.0, (0.25, 0.125)),
        pytest.param(_JACOBI, 1.0, (0.25, 0.125), marks=pytest.mark.long),
        (_LINEAR, 2.0, (0.5, 0.25)),
    ],
    ids=["gauss-seidel", "jacobi", "linear inputs"],
)
def test_the_stabilised_solution_tends_to_the_iterated_one(
    inputs: tuple[str, ...], order: float, steps: tuple[float, ...], tmp_path: Path
) -> None:
    apart = []
    for step in steps:
        size = f"coupling.step_ms={step}"
        explicit = _stress(tmp_path / f"explicit{step}", _eta(5.0), size, *inputs)
        iterated = _stress(
            tmp_path / f"iterated{step}", _eta(5.0), size, _ITERATED, *(inputs if inputs != _JACOBI else ())
        )
        apart.append(np.abs(explicit - iterated).max())
    assert np.log2(apart[-2] / apart[-1]) == pytest.approx(order, abs=0.35), apart


def test_what_an_iteration_converges_to_does_not_change(tmp_path: Path) -> None:
    # Because the reference is the stretch that the active stress saw; and it gets there sooner.
    courses, sweeps = [], []
    for share in (0.0, 1.0):
        found = _run(_CELL, tmp_path / str(share), *_COMMON, _eta(2.0), _share(share), _ITERATED)
        courses.append(found["timeseries"]["active_stress_mean_kPa"])
        sweeps.append(found["coupling"]["iterations"].mean())
    np.testing.assert_allclose(courses[1], courses[0], rtol=1e-9, atol=1e-9)
    assert sweeps[1] < 0.8 * sweeps[0]


def test_a_mechanics_that_is_told_the_stiffness_alone_takes_its_own_stretch(tmp_path: Path) -> None:
    # Held inputs: what it had at the last exchange is what the active stress saw.
    links = [
        "fibers.fiber -> electrophysiology.fiber",
        "electrophysiology.potential -> active_stress.potential",
        "mechanics.stretch -> active_stress.stretch",
        "mechanics.stretch -> electrophysiology.stretch",
        "fibers.fiber -> mechanics.fiber",
        "fibers.sheet -> mechanics.sheet",
        "active_stress.active_stress -> mechanics.active_stress",
        "active_stress.active_stiffness -> mechanics.active_stiffness",
    ]
    written = ("connect_by_name=false", f"connections={json.dumps(links)}")
    own = _stress(tmp_path / "own", _eta(5.0), *written)
    given = _stress(tmp_path / "given", _eta(5.0))
    np.testing.assert_allclose(own, given, rtol=1e-12)
    # Under Jacobi the two differ, by a step; it holds all the same.
    lagging = _stress(tmp_path / "lagging", _eta(5.0), *written, *_JACOBI)
    np.testing.assert_allclose(lagging[-5:], given[-5:], rtol=1e-2)


@pytest.mark.parametrize("scheme", [_HELD, _JACOBI, _LINEAR], ids=["gauss-seidel", "jacobi", "linear inputs"])
def test_a_heart_holds_across_the_boundary(scheme: tuple[str, ...], small_scenario: Path, tmp_path: Path) -> None:
    sets = ("run.stop_ms=12", "output.every_ms=12", _eta(6.0), *scheme, _AWAKE)
    with pytest.raises(RunError, match="length_dependence 6 makes the active stress negative"):
        _run(small_scenario, tmp_path / "outside", *sets, _share(0.0))
    held = _run(small_scenario, tmp_path / "held", *sets)["timeseries"]
    finer = _run(small_scenario, tmp_path / "finer", *sets, "coupling.step_ms=0.5")["timeseries"]
    assert abs(held["lv_volume_ml"][-1] - finer["lv_volume_ml"][-1]) < 0.2
    assert held["lv_volume_ml"][-1] < held["lv_volume_ml"][0] - 1.0
