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
@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_a_delay_is_exact_for_inputs_that_are_held_or_run_along_a_line(
    step_ms: float, interpolation: str, point: Mesh, started: Any
) -> None:
    rate, start, first, last = 0.7, -2.0, 3.0, 5.0
    parameters = {"gain": 2.0, "offset": 1.0, "delay_rate_per_ms": rate, "disturbance": start - 7.0}
    unit = started(Response, point, {**parameters, "input_interpolation": interpolation}, u=first)
    assert unit.get("y") == start
    unit.set("u", last)
    unit.do_step(0.0, 1e-3 * step_ms)
    # The particular solution and what decays to it; the target runs from 7 to 11, or is 11.
    slope = (11.0 - 7.0) / step_ms if interpolation == "linear" else 0.0
    begin = 7.0 if slope else 11.0
    exact = 11.0 - slope / rate + (start - begin + slope / rate) * np.exp(-rate * step_ms)
    assert unit.get("y") == pytest.approx(exact, rel=1e-8 if step_ms < 1e-3 else 1e-12)


@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_the_rate_is_that_of_the_last_step(interpolation: str, point: Mesh, started: Any) -> None:
    parameters = {"gain": 0.0, "rate_gain_ms": 4.0, "input_interpolation": interpolation}
    unit = started(Response, point, parameters, u=1.0)
    assert unit.get("y") == 0.0
    for time, size, u, expected in ((0.0, 2.0, 1.5, 1.0), (2.0, 0.5, 1.25, -2.0), (2.5, 1.0, 1.25, 0.0)):
        unit.set("u", u)
        unit.do_step(1e-3 * time, 1e-3 * size)
        assert unit.get("y") == pytest.approx(expected, rel=1e-12)


def test_a_ramps_begin_that_is_moved_moves_the_rate(point: Mesh, started: Any) -> None:
    # A master under which an input had been foretold wrongly says so by a step of no length.
    parameters = {"gain": 0.0, "rate_gain_ms": 1.0, "input_interpolation": "linear"}
    unit = started(Response, point, parameters, u=0.0)
    unit.set("u", 5.0)
    unit.do_step(0.0, 0.001)
    unit.set("u", 4.0)
    unit.do_step(0.001, 0.0)
    assert unit.get("y") == 5.0
    unit.set("u", 7.0)
    unit.do_step(0.001, 0.001)
    assert unit.get("y") == pytest.approx(3.0)


def test_numbers_that_leave_the_numbers_end_the_step(point: Mesh, started: Any) -> None:
    unit = started(Response, point, {"gain": 10.0})
    unit.set("u", 1e308)
    with pytest.raises(StepFailure, match="not finite"):
        unit.do_step(0.0, 0.001)
    assert unit.get("y") == 0.0
