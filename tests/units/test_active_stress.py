"""If these fail, muscle pulls too hard, too early, too late, or differently for another length of the coupling step."""

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress, Tension
from cardiac_cosim.units.errors import StepFailure
from scipy.integrate import solve_ivp

_REST, _PLATEAU = -80.0, 19.95


@pytest.fixture(scope="module")
def cube(box):
    return box([0.0, 1.0, 3.0], [0.0, 1.0], [-1.0, 0.0])


# --- the law -------------------------------------------------------------------------------------------------------


def test_delay_function_on_both_sides_of_its_threshold() -> None:
    tension = Tension()
    rates = tension.rate(np.array([-10.0, -1.0, 0.0, 1.0, 10.0]))
    # ε₀ + 0.9 exp(−exp(−Φ)); at the threshold exp(−1) of the jump has been made.
    expected = 0.1 + 0.9 * np.array([0.0, 0.06598803584531254, 0.36787944117144233, 0.6922006275553464, 0.9999546011])
    np.testing.assert_allclose(rates, expected, rtol=1e-10)
    assert (np.diff(tension.rate(np.linspace(-3.0, 10.0, 50))) > 0.0).all()


@pytest.mark.parametrize("potential", [-80.0, -1e3, -1e300, 1e3, 1e300])
def test_delay_function_does_not_overflow(potential: float) -> None:
    with np.errstate(all="raise", under="ignore"):
        rate = Tension().rate(np.array([potential]))
    assert rate[0] == (0.1 if potential < 0.0 else 1.0)


def test_seeds_delay_is_the_printed_one_and_negative_when_depolarised() -> None:
    printed = Tension(delay_function="as_printed")
    np.testing.assert_allclose(
        printed.rate(np.array([-80.0, 0.0, 20.0])), [0.1, 0.1 - 0.9 * np.exp(-1.0), -0.8], rtol=1e-6
    )


def test_plateau_is_about_half_a_megapascal(cube, started) -> None:
    # Independent computation (docs/model.md, Active stress): plateau 0.498 MPa, the target at a potential just below
    # the peak of 19.95 mV; reached within 1 % after 5 ms, five times 1/ε₁.
    unit = started(ActiveStress, cube, potential=np.full(cube.nodes, 19.6))
    unit.do_step(0.0, 0.005)
    np.testing.assert_allclose(unit.get("active_stress"), 498.0, rtol=0.01)
    unit.do_step(0.005, 0.1)
    np.testing.assert_allclose(unit.get("active_stress"), 498.0, rtol=1e-10)


# --- the step ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step_ms", [1e-6, 0.1, 1.0, 10.0, 1e5])
def test_held_potential_is_solved_exactly_for_any_step(step_ms: float, cube, started) -> None:
    potential = np.linspace(_REST, 20.0, cube.nodes)
    unit = started(ActiveStress, cube, potential=potential)
    unit.do_step(0.0, 1e-3 * step_ms)
    rate = 0.1 + 0.9 * np.exp(-np.exp(-potential))
    expected = 5.0 * (potential + 80.0) * -np.expm1(-rate * step_ms)
    np.testing.assert_allclose(unit.get("active_stress"), expected, rtol=1e-12)


@pytest.mark.parametrize("parts", [2, 7, 100])
def test_splitting_a_step_does_not_matter(parts: int, cube, started) -> None:
    potential = np.linspace(_REST, 20.0, cube.nodes)
    whole, split = (started(ActiveStress, cube, potential=np.full(cube.nodes, 20.0)) for _ in range(2))
    for unit in (whole, split):
        unit.do_step(0.0, 0.002)
        unit.set("potential", potential)
    whole.do_step(0.002, 0.004)
    for number in range(parts):
        split.do_step(0.002 + 0.004 * number / parts, 0.004 / parts)
    np.testing.assert_allclose(split.get("active_stress"), whole.get("active_stress"), rtol=1e-12)


def test_held_potential_makes_the_coupling_first_order(cube, started, slopes) -> None:
    # A potential that changes in time, held over each step: against the equation, solved by an ODE solver.
    def potential(time: float) -> float:
        return -80.0 + 100.0 * np.sin(0.05 * time) ** 2

    tension = Tension()

    def equation(time: float, stress: np.ndarray) -> np.ndarray:
        at = np.array([potential(time)])
        return tension.rate(at) * (tension.target(at) - stress)

    exact = 1000.0 * solve_ivp(equation, (0.0, 40.0), [0.0], method="DOP853", rtol=1e-11, atol=1e-12).y[0, -1]
    steps, errors = [1.0, 0.5, 0.25], []
    for step in steps:
        unit = started(ActiveStress, cube)
        for number in range(round(40.0 / step)):
            unit.set("potential", np.full(cube.nodes, potential(number * step)))
            unit.do_step(1e-3 * number * step, 1e-3 * step)
        errors.append(np.abs(unit.get("active_stress") - exact).max())
    orders = slopes(steps, errors)
    assert ((orders > 0.9) & (orders < 1.15)).all(), orders


def test_stiff_limit_is_the_target(cube, started) -> None:
    unit = started(ActiveStress, cube, {"slow_rate_per_ms": 1e6, "fast_rate_per_ms": 1e7})
    unit.set("potential", np.full(cube.nodes, _PLATEAU))
    unit.do_step(0.0, 0.001)
    np.testing.assert_allclose(unit.get("active_stress"), 5.0 * (_PLATEAU + 80.0), rtol=1e-14)
    unit.set("potential", np.full(cube.nodes, _REST))
    unit.do_step(0.001, 0.001)
    np.testing.assert_allclose(unit.get("active_stress"), 0.0, atol=1e-9)


def test_relaxation_is_slow_and_contraction_fast(cube, started) -> None:
    unit = started(ActiveStress, cube, potential=np.full(cube.nodes, 20.0))
    unit.do_step(0.0, 0.001)
    assert unit.get("active_stress")[0] == pytest.approx(500.0 * (1.0 - np.exp(-1.0)), rel=1e-8)
    unit.do_step(0.001, 0.1)
    unit.set("potential", np.full(cube.nodes, _REST))
    unit.do_step(0.101, 0.001)
    assert unit.get("active_stress")[0] == pytest.approx(500.0 * np.exp(-0.1), rel=1e-10)


def test_nodes_do_not_see_each_other(cube, started) -> None:
    potential = np.full(cube.nodes, _REST)
    potential[3] = 20.0
    unit = started(ActiveStress, cube, potential=potential)
    unit.do_step(0.0, 0.01)
    stress = unit.get("active_stress")
    assert stress[3] > 400.0
    assert not np.delete(stress, 3).any()


def test_start_has_no_active_stress_whatever_the_potential(cube, started) -> None:
    assert not started(ActiveStress, cube, potential=np.full(cube.nodes, 20.0)).get("active_stress").any()


def test_step_of_zero_leaves_the_state_to_the_bit(cube, started) -> None:
    unit = started(ActiveStress, cube, potential=np.linspace(_REST, 20.0, cube.nodes))
    unit.do_step(0.0, 0.003)
    before = unit.get_state()
    unit.set("potential", np.linspace(20.0, _REST, cube.nodes))
    unit.do_step(0.003, 0.0)
    for name, value in before.state.items():
        assert unit.get_state().state[name].tobytes() == value.tobytes(), name


# --- the printed delay fails ------------------------------------------------------------------------------------------


def test_seeds_delay_runs_at_rest_and_fails_when_depolarised(cube, started) -> None:
    unit = started(ActiveStress, cube, {"delay_function": "as_printed"})
    unit.do_step(0.0, 0.001)
    assert not unit.get("active_stress").any()
    potential = np.full(cube.nodes, _REST)
    # ε = 0.1 − 0.9 exp(−exp(−Φ)) changes sign at Φ = −ln ln 9 = −0.787 mV.
    potential[5] = -0.78
    unit.set("potential", potential)
    before = unit.get_state()
    reason = r"node 5 .*-0\.8 mV.*as printed in the source document; use delay_function: gompertz"
    with pytest.raises(StepFailure, match=reason):
        unit.do_step(0.001, 0.001)
    assert all(unit.get_state().state[name] is value for name, value in before.state.items())
    potential[5] = -0.80
    unit.set("potential", potential)
    unit.do_step(0.001, 0.001)
    assert unit.get("active_stress")[5] > 0.0


# --- length dependence ---------------------------------------------------------------------------------------------


def test_length_dependence_scales_by_the_volume_averaged_stretch(cube, started) -> None:
    stretch = 1.0 + np.random.default_rng(6).uniform(-0.1, 0.1, cube.elements)
    inputs = {"potential": np.full(cube.nodes, 20.0), "stretch": stretch}
    plain = started(ActiveStress, cube, **inputs)
    scaled = started(ActiveStress, cube, {"length_dependence": 2.0}, **inputs)
    for unit in (plain, scaled):
        unit.do_step(0.0, 0.01)
    average = [
        np.average(stretch[(cube.cells == node).any(axis=1)], weights=cube.volumes[(cube.cells == node).any(axis=1)])
        for node in range(cube.nodes)
    ]
    factor = 1.0 + 2.0 * (np.array(average) - 1.0)
    assert np.ptp(factor) > 0.05
    assert plain.get("active_stress") == pytest.approx(500.0, rel=1e-3)
    np.testing.assert_allclose(scaled.get("active_stress"), factor * plain.get("active_stress"), rtol=1e-12)


def test_length_dependence_has_no_memory_of_the_stretch(cube, started) -> None:
    # The stretch scales what comes out, not what is remembered: back at rest length nothing of it is left.
    inputs = {"potential": np.full(cube.nodes, 20.0)}
    plain = started(ActiveStress, cube, **inputs)
    scaled = started(ActiveStress, cube, {"length_dependence": 2.0}, **inputs)
    for number, stretch in enumerate((0.9, 1.2, 1.0)):
        scaled.set("stretch", np.full(cube.elements, stretch))
        for unit in (plain, scaled):
            unit.do_step(0.001 * number, 0.001)
    np.testing.assert_allclose(scaled.get("active_stress"), plain.get("active_stress"), rtol=1e-13)


def test_stretch_does_not_matter_without_length_dependence(cube, started) -> None:
    units = [
        started(ActiveStress, cube, potential=np.full(cube.nodes, 20.0), stretch=np.full(cube.elements, stretch))
        for stretch in (0.7, 1.0)
    ]
    for unit in units:
        unit.do_step(0.0, 0.01)
    np.testing.assert_array_equal(units[0].get("active_stress"), units[1].get("active_stress"))


def test_length_dependence_that_would_push_is_refused(cube, started) -> None:
    unit = started(ActiveStress, cube, {"length_dependence": 5.0}, potential=np.full(cube.nodes, 20.0))
    unit.set("stretch", np.full(cube.elements, 0.81))
    unit.do_step(0.0, 0.001)
    assert (unit.get("active_stress") > 0.0).all()
    unit.set("stretch", np.full(cube.elements, 0.79))
    with pytest.raises(StepFailure, match="length_dependence 5 makes the active stress negative"):
        unit.do_step(0.001, 0.001)


# --- what stabilises a loop ----------------------------------------------------------------------------------------


def test_active_stiffness_is_the_derivative_by_the_stretch(cube, started) -> None:
    eta, change = 2.0, 1e-4
    potential = np.linspace(_REST, 20.0, cube.nodes)
    found = []
    for stretch in (0.95 - change, 0.95, 0.95 + change):
        unit = started(ActiveStress, cube, {"length_dependence": eta}, potential=potential)
        unit.set("stretch", np.full(cube.elements, stretch))
        unit.do_step(0.0, 0.003)
        found.append(unit)
    low, middle, high = found
    slope = (high.get("active_stress") - low.get("active_stress")) / (2.0 * change)
    assert slope.max() > 500.0
    np.testing.assert_allclose(middle.get("active_stiffness"), slope, rtol=1e-9, atol=1e-9)


def test_reference_stretch_is_the_one_that_was_seen_whatever_is_set_since(cube, started) -> None:
    unit = started(ActiveStress, cube, {"length_dependence": 2.0})
    seen = 1.0 + np.random.default_rng(6).uniform(-0.1, 0.1, cube.elements)
    unit.set("stretch", seen)
    unit.do_step(0.0, 0.001)
    unit.set("stretch", np.full(cube.elements, 0.8))
    np.testing.assert_array_equal(unit.get("reference_stretch"), seen)
    unit.do_step(0.001, 0.001)
    np.testing.assert_array_equal(unit.get("reference_stretch"), 0.8)


def test_without_length_dependence_there_is_neither_stiffness_nor_reference(cube, started) -> None:
    unit = started(ActiveStress, cube, potential=np.full(cube.nodes, 20.0))
    unit.do_step(0.0, 0.01)
    assert not unit.get("active_stiffness").any()
    assert not unit.get("reference_stretch").any()
    assert "reference_stretch" not in unit.get_state().state


# --- forward Euler -------------------------------------------------------------------------------------------------


def _relaxed(cube, started, step_ms: float, steps: int, **parameters) -> np.ndarray:
    """Distance from the target of 500 kPa after each step, relative to that at first; fast rate 1/ms."""
    unit = started(ActiveStress, cube, parameters, potential=np.full(cube.nodes, 20.0))
    course = []
    for number in range(steps):
        unit.do_step(1e-3 * step_ms * number, 1e-3 * step_ms)
        course.append(1.0 - unit.get("active_stress")[0] / 500.0)
    return np.array(course)


@pytest.mark.parametrize("step_ms", [0.5, 1.99, 2.01, 2.2])
def test_forward_euler_is_stable_below_two_time_constants_and_not_above(step_ms: float, cube, started) -> None:
    course = _relaxed(cube, started, step_ms, 20, time_integration="forward_euler")
    np.testing.assert_allclose(course[1:] / course[:-1], 1.0 - step_ms, rtol=1e-6)
    assert (abs(course[-1]) < 1.0) == (step_ms < 2.0)
    # The solution by which the unit steps otherwise knows no limit.
    exact = _relaxed(cube, started, step_ms, 20)
    np.testing.assert_allclose(exact, np.exp(-step_ms * np.arange(1, 21)), rtol=1e-6, atol=1e-12)


def test_forward_euler_tends_to_the_exact_solution_at_first_order(cube, started, slopes) -> None:
    steps = np.array([0.4, 0.2, 0.1, 0.05])
    errors = [
        abs(_relaxed(cube, started, step, round(2.0 / step), time_integration="forward_euler")[-1] - np.exp(-2.0))
        for step in steps
    ]
    assert slopes(steps, errors)[-1] == pytest.approx(1.0, abs=0.1)
