"""If these fail, what schemes are tried on is no mass on a spring, and every limit measured with it is of nothing."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.errors import StepFailure
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.test_problems import Mass
from scipy.integrate import solve_ivp

_PARAMETERS = {"m": 1.7, "k": 12.0, "c": 0.3, "k_c": 5.0, "c_c": 0.8, "x_start": 0.4, "v_start": -1.1}


@pytest.fixture(scope="module")
def point() -> Mesh:
    return build("cell", 5.0)


def _exact(inputs: Any, end: float) -> np.ndarray:
    """x and v at `end` (s) for the inputs F_in, x_in, v_in at a time, by tight integration."""

    def rates(time: float, values: np.ndarray) -> list[float]:
        (x, v), (force, place, speed) = values, inputs(time)
        return [v, (force - 12.0 * x - 0.3 * v + 5.0 * (place - x) + 0.8 * (speed - v)) / 1.7]

    return solve_ivp(rates, (0.0, end), [0.4, -1.1], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


@pytest.mark.parametrize("step", [1e-3, 0.3, 4.0])
@pytest.mark.parametrize("ramped", [False, True])
def test_a_step_is_exact_for_inputs_that_are_held_or_run_along_a_line(
    step: float, ramped: bool, point: Mesh, started: Any
) -> None:
    first, last = np.array([1.0, -0.5, 2.0]), np.array([-2.0, 0.7, 0.1])
    names = ("F_in", "x_in", "v_in")
    unit = started(Mass, point, _PARAMETERS, **dict(zip(names, first, strict=True)))
    unit.do_step(0.0, step, dict(zip(names, last, strict=True)) if ramped else None)
    x, v = _exact(lambda time: first + time / step * (last - first) if ramped else first, step)
    _, place, speed = last if ramped else first
    assert unit.get("x") == pytest.approx(x, rel=1e-9, abs=1e-10)
    assert unit.get("v") == pytest.approx(v, rel=1e-9, abs=1e-10)
    assert unit.get("F") == pytest.approx(5.0 * (x - place) + 0.8 * (v - speed), rel=1e-9)


def test_ramped_inputs_are_of_second_order_and_held_ones_of_first(point: Mesh, started: Any, slopes: Any) -> None:
    def inputs(time: float) -> np.ndarray:
        return np.array([np.sin(3.0 * time), np.cos(2.0 * time), -np.sin(time)])

    exact, counts = _exact(inputs, 2.0), (80, 160, 320)
    for ramped, order in ((False, 1.0), (True, 2.0)):
        errors = []
        for count in counts:
            names = ("F_in", "x_in", "v_in")
            unit = started(Mass, point, _PARAMETERS)
            for number in range(count):
                begin, end = (
                    dict(zip(names, inputs(2.0 * moment / count), strict=True)) for moment in (number, number + 1)
                )
                for name, value in begin.items():
                    unit.set(name, value)
                unit.do_step(2.0 * number / count, 2.0 / count, end if ramped else None)
            errors.append(abs(float(unit.get("x")) - exact[0]))
        np.testing.assert_allclose(slopes([2.0 / count for count in counts], errors), order, atol=0.1)


def test_a_mass_that_nothing_loses_keeps_its_energy(point: Mesh, started: Any) -> None:
    unit = started(Mass, point, {"m": 2.0, "k": 8.0, "x_start": 1.0})
    for number in range(1000):
        unit.do_step(0.1 * number, 0.1)
    # Of 4 J, with the frequency 2 rad/s.
    assert unit.get("x") == pytest.approx(np.cos(200.0), abs=1e-9)
    assert 4.0 * unit.get("x") ** 2 + unit.get("v") ** 2 == pytest.approx(4.0, rel=1e-10)


def test_a_step_of_no_length_moves_the_force_and_nothing_else(point: Mesh, started: Any) -> None:
    # A master that knows the inputs anew asks for it so.
    unit = started(Mass, point, _PARAMETERS, x_in=0.1)
    unit.do_step(0.0, 0.01)
    x, v = float(unit.get("x")), float(unit.get("v"))
    unit.set("x_in", 0.9)
    unit.do_step(0.01, 0.0)
    assert (unit.get("x"), unit.get("v")) == (x, v)
    assert unit.get("F") == pytest.approx(5.0 * (x - 0.9) + 0.8 * v, rel=1e-12)


def test_numbers_that_leave_the_numbers_end_the_step(point: Mesh, started: Any) -> None:
    unit = started(Mass, point, {"k": 1.0})
    unit.set("F_in", 1e308)
    unit.do_step(0.0, 1.0)
    before = float(unit.get("x"))
    unit.set("F_in", 1.7e308)
    with pytest.raises(StepFailure, match="not finite"):
        unit.do_step(1.0, 3.0)
    assert unit.get("x") == before
