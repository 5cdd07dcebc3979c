"""If these fail, the simplest loops are not the ones of the closed forms that they are held against."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.errors import StepFailure
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.test_problems import Response


@pytest.fixture(scope="module")
def point() -> Mesh:
    return build("cell", 5.0)


def test_without_a_delay_it_follows_at_once(point: Mesh, started: Any) -> None:
    unit = started(Response, point, {"gain": -3.0, "offset": 0.5, "disturbance": 9.0}, u=2.0)
    assert unit.get("y") == 3.5
    unit.set("u", -2.0)
    unit.do_step(0.0, 1e-6)
    assert unit.get("y") == 6.5


@pytest.mark.parametrize("step_ms", [1e-6, 0.3, 2.0, 500.0])
@pytest.mark.parametrize("ramped", [False, True])
def test_a_delay_is_exact_for_inputs_that_are_held_or_run_along_a_line(
    step_ms: float, ramped: bool, point: Mesh, started: Any
) -> None:
    rate, start, first, last = 0.7, -2.0, 3.0, 5.0
    parameters = {"gain": 2.0, "offset": 1.0, "delay_rate_per_ms": rate, "disturbance": start - 7.0}
    unit = started(Response, point, parameters, u=first)
    assert unit.get("y") == start
    unit.do_step(0.0, 1e-3 * step_ms, {"u": last} if ramped else None)
    # The particular solution and what decays to it; the target runs from 7 to 11, or stays 7.
    slope, end = ((11.0 - 7.0) / step_ms, 11.0) if ramped else (0.0, 7.0)
    exact = end - slope / rate + (start - 7.0 + slope / rate) * np.exp(-rate * step_ms)
    assert unit.get("y") == pytest.approx(exact, rel=1e-8 if step_ms < 1e-3 else 1e-12)


def test_the_rate_of_a_held_input_is_that_of_its_jump_since_the_last_step(point: Mesh, started: Any) -> None:
    unit = started(Response, point, {"gain": 0.0, "rate_gain_ms": 4.0}, u=1.0)
    assert unit.get("y") == 0.0
    for time, size, u, expected in ((0.0, 2.0, 1.5, 1.0), (2.0, 0.5, 1.25, -2.0), (2.5, 1.0, 1.25, 0.0)):
        unit.set("u", u)
        unit.do_step(1e-3 * time, 1e-3 * size)
        assert unit.get("y") == pytest.approx(expected, rel=1e-12)


def test_the_rate_of_an_input_that_runs_to_an_end_is_that_of_the_step(point: Mesh, started: Any) -> None:
    # What the input had been before the step, extrapolated wrongly perhaps, does not matter.
    unit = started(Response, point, {"gain": 0.0, "rate_gain_ms": 1.0}, u=0.0)
    unit.do_step(0.0, 0.001, {"u": 5.0})
    assert unit.get("y") == pytest.approx(5.0)
    unit.set("u", 4.0)
    unit.do_step(0.001, 0.0)
    assert unit.get("y") == pytest.approx(5.0)
    unit.do_step(0.001, 0.002, {"u": 7.0})
    assert unit.get("y") == pytest.approx(1.5)


def test_numbers_that_leave_the_numbers_end_the_step(point: Mesh, started: Any) -> None:
    unit = started(Response, point, {"gain": 10.0})
    unit.set("u", 1e308)
    with pytest.raises(StepFailure, match="not finite"):
        unit.do_step(0.0, 0.001)
    assert unit.get("y") == 0.0
