"""If these fail, the coupled solution is not that of the coupled equations, however good each unit is by itself."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.exchange import Exchange
from cardiac_cosim.orchestrator.coupling.master import Accepted
from cardiac_cosim.orchestrator.coupling.schemes import SCHEMES
from scipy.linalg import expm

Run = Callable[..., list[list[float]]]


class _Watch:
    """The outputs `x` of all units after every step."""

    def __init__(self, units: dict[str, Any]) -> None:
        self._units = [name for name, unit in units.items() if "x" in unit.outputs]
        self.rows: list[list[float]] = []

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        self.rows.append([float(exchange.value(unit, "x")) for unit in self._units])


@pytest.fixture
def run(master: Any) -> Run:
    """Couple `units` by the `written` connections and return all outputs `x`, a row per time."""

    def couple(
        units: dict[str, Any], written: list[str], scheme: str, steps: int, step_ms: float = 1.0, order: Any = None
    ) -> list[list[float]]:
        watch = _Watch(units)
        master(units, steps, written, scheme=scheme, step_ms=step_ms, order=order).run([watch])
        return watch.rows

    return couple


def test_the_schemes_of_the_contract_are_there() -> None:
    assert sorted(SCHEMES) == ["gauss-seidel", "jacobi"]


# --- an instantaneous loop x = c + g x, over two units -------------------------------------------------------------

_RING = ["a.x -> b.u", "b.x -> a.u"]


def _ring(fake: Any, port: Any, gain: float, offset: float) -> dict[str, Any]:
    """a: x = c + g u, b: x = u; both jump to what their input says."""
    return {
        "a": fake("a", [port("u")], [port("x")], lambda given, *_: {"x": offset + gain * given["u"]}),
        "b": fake("b", [port("u")], [port("x")], lambda given, *_: {"x": given["u"]}),
    }


@pytest.mark.parametrize("gain", [0.5, -0.9, 0.0, 1.25, -2.0])
@pytest.mark.parametrize("step_ms", [1e-3, 1.0, 50.0])
def test_gauss_seidel_multiplies_the_error_of_a_loop_by_its_gain_whatever_the_step(
    fake, port, run: Run, gain: float, step_ms: float
) -> None:
    # Both units start at 0, so the error before the first step is −x*.
    fixed_point = 3.0 / (1.0 - gain)
    rows = run(_ring(fake, port, gain, 3.0), _RING, "gauss-seidel", 12, step_ms)
    errors = [row[0] - fixed_point for row in rows]
    np.testing.assert_allclose(errors, [-fixed_point * gain**number for number in range(13)], rtol=1e-9, atol=1e-12)


def test_jacobi_needs_two_steps_for_one_turn_of_the_loop(fake, port, run: Run) -> None:
    gain, fixed_point = -0.5, 2.0
    rows = run(_ring(fake, port, gain, 3.0), _RING, "jacobi", 10)
    errors = np.array(rows) - fixed_point
    np.testing.assert_allclose(errors[2:, 0], gain * errors[:-2, 0], rtol=1e-12)
    np.testing.assert_allclose(errors[1:, 1], errors[:-1, 0], rtol=1e-12)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("gain", [0.95, -0.95, 1.05, -1.05])
def test_an_explicit_loop_is_stable_exactly_for_gains_below_one(fake, port, run: Run, scheme: str, gain: float) -> None:
    rows = run(_ring(fake, port, gain, 1.0), _RING, scheme, 400)
    error = abs(rows[-1][0] - 1.0 / (1.0 - gain))
    assert (error < 1e-3) if abs(gain) < 1.0 else (error > 1e3)


# --- who sees what ------------------------------------------------------------------------------------------------


def _clock(fake: Any, port: Any, name: str, follows: str) -> Any:
    """Its output is 100 times its input plus the number of its step, so that every value tells its history."""
    return fake(
        name,
        [port(follows)],
        [port("x")],
        lambda given, before, time, size: {"x": 100.0 * given[follows] + round(time / size) + 1},
    )


@pytest.mark.parametrize(
    ("scheme", "order", "after_one", "after_two"),
    [
        # Jacobi: both see the values of the step's begin, in whatever order.
        ("jacobi", ["a", "b"], [1, 1], [102, 102]),
        ("jacobi", ["b", "a"], [1, 1], [102, 102]),
        # Gauss–Seidel: the second sees what the first has just computed.
        ("gauss-seidel", ["a", "b"], [1, 101], [10102, 1010202]),
        ("gauss-seidel", ["b", "a"], [101, 1], [1010202, 10102]),
    ],
)
def test_the_values_a_unit_sees(
    fake, port, run: Run, scheme: str, order: list[str], after_one: list[float], after_two: list[float]
) -> None:
    units = {"a": _clock(fake, port, "a", "u"), "b": _clock(fake, port, "b", "u")}
    assert run(units, _RING, scheme, 2, order=order) == [[0, 0], after_one, after_two]


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_every_unit_steps_once_per_step_in_the_given_order_at_its_time(fake, port, run: Run, scheme: str) -> None:
    calls: list[tuple[Any, ...]] = []
    units = {name: fake(name, [port("u")], [port("x")], calls=calls) for name in "abc"}
    run(units, [], scheme, 2, step_ms=2.0, order=["c", "a", "b"])
    steps = [call for call in calls if call[1] == "step"]
    assert steps == [(name, "step", time, 0.002) for time in (0.0, 0.002) for name in "cab"]


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_what_is_fixed_crosses_once_and_before_the_receiver_is_initialised(fake, port, run: Run, scheme: str) -> None:
    calls: list[tuple[Any, ...]] = []
    units = {
        # Declared last-first, so that the order of initialisation cannot be that of the declaration.
        "user": fake("user", [port("f", fixed=True), port("x"), port("late", fixed=True)], [port("x")], calls=calls),
        "mover": fake("mover", [port("f")], [port("x"), port("late")], calls=calls),
        "maker": fake("maker", [], [port("f", fixed=True)], begins={"f": 5.0}, calls=calls),
    }
    run(units, ["mover.x -> user.x"], scheme, 3)
    assert [call for call in calls if call[2:3] == ("f",)] == [
        ("mover", "set", "f", 5.0),
        ("user", "set", "f", 5.0),
    ]
    # An input that is fixed takes its value once even if its source moves.
    assert sum(call[:3] == ("user", "set", "late") for call in calls) == 1
    assert sum(call[:3] == ("user", "set", "x") for call in calls) == 1 + 3
    assert calls.index(("user", "set", "f", 5.0)) < calls.index(("user", "complete"))
    assert not any(call[:2] == ("maker", "step") for call in calls)


# --- x' = A x, each row a unit that solves its own equation exactly while the other's value is held ---------------

_A = np.array([[-1.0, 2.0], [-3.0, -0.5]])
_START = np.array([1.0, -0.5])
_END_S = 1.0


def _row(fake: Any, port: Any, name: str, own: int) -> Any:
    rate, coupling = _A[own, own], _A[own, 1 - own]

    def law(given: Any, before: Any, time: float, size: float) -> dict[str, float]:
        pull = coupling * given["u"] / rate
        return {"x": (before["x"] + pull) * np.exp(rate * size) - pull}

    return fake(name, [port("u")], [port("x")], law, begins={"x": _START[own]})


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_both_schemes_tend_to_the_exact_solution_at_first_order(fake, port, run: Run, scheme: str) -> None:
    exact = expm(_A * _END_S) @ _START
    counts = [100, 200, 400, 800]
    solutions = []
    for steps in counts:
        units = {"a": _row(fake, port, "a", 0), "b": _row(fake, port, "b", 1)}
        solutions.append(run(units, _RING, scheme, steps, step_ms=1000.0 * _END_S / steps)[-1])
    errors = np.linalg.norm(np.array(solutions) - exact, axis=1)
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:])[1:], 1.0, atol=0.03)
    # What remains when the first order is taken out (Richardson) shows that the limit is the exact solution.
    limit = 2.0 * np.array(solutions[-1]) - np.array(solutions[-2])
    assert np.linalg.norm(limit - exact) < 0.01 * errors[-1]
