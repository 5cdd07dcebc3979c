"""If these fail, a host that loses count of the time gets numbers for it, or one that keeps count is refused."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

Make = Callable[..., Any]

_NAN, _INF = math.nan, math.inf


def _ready(make: Make, stop: float = math.inf) -> Any:
    driver = make("mass")
    driver.start({"k": 5.0, "c": 0.5, "x_start": 1.0}, {"F_in": [0.25]}, stop)
    assert driver.messages == []
    return driver


def _unchanged(driver: Any, time: float, size: float, message: str) -> None:
    """The step is an error for which the caller is to blame, and nothing has changed."""
    before, seen = driver.packed(), driver.outputs()
    driver.messages.clear()
    assert driver.step(time, size) == 3
    ((status, category, text),) = driver.messages
    assert (status, category) == (3, "invalidInput")
    assert message in text
    assert driver.packed() == before
    for name, values in driver.outputs().items():
        np.testing.assert_array_equal(values, seen[name])
    driver.messages.clear()


@pytest.mark.parametrize("size", [0.0, -0.0, -0.1, _NAN, _INF, -_INF])
def test_a_step_has_a_size(size: float, make: Make) -> None:
    driver, other = _ready(make), _ready(make)
    _unchanged(driver, 0.0, size, "the size above 0")
    for one in (driver, other):
        assert one.step(0.0, 0.1) == 0
    _unchanged(driver, 0.1, size, "the size above 0")
    for one in (driver, other):
        assert one.step(0.1, 0.1) == 0
    assert driver.packed() == other.packed()


@pytest.mark.parametrize("time", [_NAN, _INF, -_INF])
def test_a_time_is_a_number(time: float, make: Make) -> None:
    _unchanged(_ready(make), time, 0.1, "both have to be finite")


def test_steps_follow_one_another(make: Make) -> None:
    driver = _ready(make)
    _unchanged(driver, 0.1, 0.1, "the instance is at 0 s")
    assert driver.step(0.0, 0.1) == 0
    # Again, back, with an overlap, and with a gap.
    for time in (0.0, -0.1, 0.05, 0.2):
        _unchanged(driver, time, 0.1, "the instance is at 0.1 s")
    assert driver.step(0.1, 0.1) == 0


def test_what_hosts_round_is_no_gap(make: Make) -> None:
    driver = _ready(make, stop=1.0)
    time = 0.0
    for number in range(1000):
        # One host adds the sizes up, another multiplies, a third one takes differences of times.
        size = 1e-3 if number % 3 else (number + 1) * 1e-3 - number * 1e-3
        assert driver.step(time if number % 2 else number * 1e-3, size) == 0
        time += 1e-3
    assert driver.reached() == pytest.approx(1.0, abs=1e-12)
    assert driver.messages == []


def test_the_stop_time_is_kept(make: Make) -> None:
    driver = _ready(make, stop=0.3)
    assert driver.step(0.0, 0.1) == 0
    _unchanged(driver, 0.1, 0.3, "passes the stop time of the experiment, 0.3 s")
    # In doubles 0.1 + 0.2 is more than 0.3.
    assert driver.step(0.1, 0.2) == 0
    assert driver.reached() > 0.3
    _unchanged(driver, driver.reached(), 0.1, "passes the stop time of the experiment")
    assert driver.terminate() == 0


def test_without_a_stop_time_there_is_no_end(make: Make) -> None:
    driver = _ready(make)
    assert driver.step(0.0, 1e6) == 0
    assert driver.step(1e6, 1e6) == 0


def test_no_steps_but_between_initialization_and_termination(make: Make) -> None:
    driver = make("mass")
    _unchanged(driver, 0.0, 0.1, "unit 'mass' is instantiated; it steps between the end of its initialization and")
    driver.setup()
    driver.enter()
    _unchanged(driver, 0.0, 0.1, "unit 'mass' is in initialization mode")
    driver.leave()
    assert driver.step(0.0, 0.1) == 0
    assert driver.terminate() == 0
    _unchanged(driver, 0.1, 0.1, "unit 'mass' is terminated")
    driver.reset()
    _unchanged(driver, 0.0, 0.1, "unit 'mass' is instantiated")


@pytest.mark.parametrize(("start", "stop"), [(_NAN, _INF), (_INF, _INF), (-_INF, 1.0), (0.0, -1.0), (0.0, _NAN)])
def test_an_experiment_has_a_begin_before_its_end(start: float, stop: float, make: Make) -> None:
    driver = make("mass")
    driver.parameterize({"x_start": 1.0})
    before = driver.packed()
    statuses = [driver.setup(start, stop)]
    if driver.fmi == 3:
        # Which has the times there.
        statuses = [driver.enter()]
    # A stop time that is not below infinity is one that is not defined.
    if math.isnan(stop):
        assert statuses == [0]
        return
    assert statuses == [3]
    assert "an experiment cannot run from" in driver.errors()
    assert driver.packed() == before
    driver.setup()
    assert driver.enter() == 0


def test_units_with_a_memory_start_at_zero(make: Make, cases: dict) -> None:
    def started(unit: str) -> Any:
        driver = make(unit)
        status = driver.setup(0.5, 2.0)
        status = max(status, driver.enter())
        return driver, status

    driver, _ = started("mass")
    assert "unit 'mass' starts at t = 0 s, not at 0.5 s" in driver.errors()
    # What only follows its inputs begins at any time.
    driver, status = started("mechanics")
    assert status == 0
    for name, values in cases["mechanics"].first().items():
        driver.set(name, values)
    assert driver.leave() == 0
    _unchanged(driver, 0.0, 0.1, "the instance is at 0.5 s")
    assert driver.step(0.5, 0.1) == 0
    assert driver.reached() == 0.6
