"""If these fail, a unit that ramps its inputs follows something else than what was exchanged, or rolls back wrongly."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress, Tension
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.snapshot import Snapshot
from scipy.integrate import solve_ivp

_GENTLE = {"delay_slope_per_mV": 0.05}


@pytest.fixture(scope="module")
def cube(box: Any) -> Any:
    return box([0.0, 1.0, 3.0], [0.0, 1.0], [-1.0, 0.0])


@pytest.fixture(scope="module")
def bar(box: Any) -> Any:
    return box(np.linspace(0.0, 20.0, 21), [0.0, 1.0], [-1.0, 0.0])


def _ramped(started: Any, kind: Any, mesh: Any, **given: Any) -> Any:
    parameters = {"input_interpolation": "linear"} | given.pop("parameters", {})
    return started(kind, mesh, parameters=parameters, **given)


# --- active stress ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step_ms", [1e-3, 1.0, 5.0, 1e3])
def test_a_ramped_potential_gives_the_mean_over_the_moments_of_its_change(step_ms: float, cube: Any, started) -> None:
    first, last = np.full(cube.nodes, -70.0), np.linspace(-80.0, 20.0, cube.nodes)
    unit = _ramped(started, ActiveStress, cube, potential=first)
    unit.set("potential", last)
    unit.do_step(0.0, 1e-3 * step_ms)
    law, moments = Tension(), (np.polynomial.legendre.leggauss(400)[0] + 1.0) / 2.0
    weights = np.polynomial.legendre.leggauss(400)[1] / 2.0
    before, after = law.rate(first) * step_ms, law.rate(last) * step_ms
    expected = np.zeros(cube.nodes)
    for moment, weight in zip(moments, weights, strict=True):
        reached = law.target(first) * -np.expm1(-before * moment)
        expected += weight * (law.target(last) + (reached - law.target(last)) * np.exp(-after * (1.0 - moment)))
    np.testing.assert_allclose(unit.get("active_stress"), 1e3 * expected, rtol=1e-7 if step_ms < 100.0 else 1e-3)


def test_ramped_inputs_make_active_stress_second_order(cube: Any, started: Any) -> None:
    def potential(time: float) -> np.ndarray:
        return np.linspace(-80.0, -60.0, cube.nodes) + 80.0 * np.sin(0.1 * time) ** 2

    law = Tension(**_GENTLE)
    exact = solve_ivp(
        lambda time, tension: law.rate(potential(time)) * (law.target(potential(time)) - tension),
        (0.0, 20.0),
        np.zeros(cube.nodes),
        rtol=1e-10,
        atol=1e-12,
    ).y[:, -1]

    def errors(interpolation: str) -> np.ndarray:
        found = []
        for count in (100, 200, 400):
            parameters = _GENTLE | {"input_interpolation": interpolation}
            unit = started(ActiveStress, cube, parameters=parameters, potential=potential(0.0))
            for number in range(count):
                unit.set("potential", potential(20.0 * (number + 1) / count))
                unit.do_step(0.02 * number / count, 0.02 / count)
            found.append(np.abs(unit.get("active_stress") - 1e3 * exact).max())
        return np.log2(np.array(found[:-1]) / np.array(found[1:]))

    np.testing.assert_allclose(errors("linear"), 2.0, atol=0.15)
    np.testing.assert_allclose(errors("hold"), 1.0, atol=0.15)


# --- electrophysiology --------------------------------------------------------------------------------------------


def test_ramped_stretch_makes_electrophysiology_second_order(bar: Any, started: Any) -> None:
    fiber = np.tile([1.0, 0.0, 0.0], (bar.elements, 1))
    centres = bar.points[bar.cells].mean(axis=1)[:, 0]

    def stretch(time: float) -> np.ndarray:
        return 1.0 + 0.02 * (1.0 + np.sin(0.3 * time + 0.1 * centres))

    def run(count: int, interpolation: str) -> np.ndarray:
        parameters = {"input_interpolation": interpolation, "longest_substep_ms": 0.0625}
        unit = started(Electrophysiology, bar, parameters=parameters, fiber=fiber, stretch=stretch(0.0))
        for number in range(count):
            unit.set("stretch", stretch(8.0 * (number + 1) / count))
            unit.do_step(0.008 * number / count, 0.008 / count)
        return np.array(unit.get("potential"))

    for interpolation, order in (("linear", 2.0), ("hold", 1.0)):
        values = [run(count, interpolation) for count in (4, 8, 16, 32)]
        changes = [np.abs(fine - coarse).max() for coarse, fine in pairwise(values)]
        np.testing.assert_allclose(np.log2(np.array(changes[:-1]) / np.array(changes[1:])), order, atol=0.25)


# --- where a ramp begins ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("same", [True, False])
def test_an_input_that_does_not_change_is_as_if_held(same: bool, cube: Any, started: Any) -> None:
    value = np.full(cube.nodes, 10.0)
    held = started(ActiveStress, cube, potential=value)
    ramped = _ramped(started, ActiveStress, cube, potential=value)
    for unit in (held, ramped):
        if same:
            unit.set("potential", value.copy())
        unit.do_step(0.0, 0.005)
    assert np.array_equal(held.get("active_stress"), ramped.get("active_stress"))


def test_a_step_of_zero_length_moves_the_begin_of_the_ramp(cube: Any, started: Any) -> None:
    low, high = np.full(cube.nodes, -80.0), np.full(cube.nodes, 15.0)
    moved = _ramped(started, ActiveStress, cube, potential=low)
    moved.set("potential", high)
    moved.do_step(0.0, 0.0)
    np.testing.assert_array_equal(moved.get("active_stress"), 0.0)
    moved.do_step(0.0, 0.005)
    held = started(ActiveStress, cube, potential=high)
    held.do_step(0.0, 0.005)
    assert np.array_equal(moved.get("active_stress"), held.get("active_stress"))


def test_the_begin_of_a_ramp_is_part_of_the_state(cube: Any, started: Any) -> None:
    values = [np.full(cube.nodes, value) for value in (-80.0, -20.0, 15.0)]
    unit = _ramped(started, ActiveStress, cube, potential=values[0])
    unit.set("potential", values[1])
    unit.do_step(0.0, 0.002)
    saved = Snapshot.from_bytes(unit.get_state().to_bytes())
    results = []
    for _ in range(2):
        unit.set("potential", values[2])
        unit.do_step(0.002, 0.002)
        results.append(unit.get("active_stress"))
        unit.do_step(0.004, 0.05)
        unit.set_state(saved)
    assert np.array_equal(results[0], results[1])
