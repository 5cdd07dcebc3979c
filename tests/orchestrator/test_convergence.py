"""If these fail, a loop is taken for solved because nothing has arrived yet, or because its numbers leave the scale."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.acceleration import Acceleration, Aitken, Anderson, Relaxation
from cardiac_cosim.orchestrator.coupling.connections import connect
from cardiac_cosim.orchestrator.coupling.convergence import Convergence, Criterion
from cardiac_cosim.orchestrator.coupling.iteration import Iterated, Limits
from cardiac_cosim.orchestrator.coupling.master import Accepted, Master
from cardiac_cosim.orchestrator.coupling.norm import norm
from cardiac_cosim.orchestrator.coupling.schemes import SCHEMES
from cardiac_cosim.orchestrator.coupling.timeline import Timeline
from cardiac_cosim.orchestrator.errors import RunError
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

Solve = Callable[..., tuple[Master, list[Accepted]]]

_ACCELERATIONS = {
    "none": lambda: Relaxation(1.0),
    "relaxation": lambda: Relaxation(0.5),
    "aitken": lambda: Aitken(0.5),
    "anderson": lambda: Anderson(1.0),
}


class _Watch:
    def __init__(self) -> None:
        self.steps: list[Accepted] = []

    def accept(self, step: Accepted, exchange: Any) -> None:
        self.steps.append(step)


@pytest.fixture
def solve() -> Solve:
    """Run units for some iterated steps."""

    def run(
        units: dict[str, Any],
        criteria: Mapping[str, Criterion],
        scheme: str = "jacobi",
        acceleration: Acceleration | None = None,
        written: Sequence[str] = (),
        steps: int = 1,
        limit: int = 400,
        **rest: Any,
    ) -> tuple[Master, list[Accepted]]:
        connections = connect(units, written)
        limits = Limits(criteria, limit, True)
        iterated = Iterated(SCHEMES[scheme](), units, connections, acceleration or Relaxation(1.0), limits)
        timeline = Timeline.of_fixed_step(1.0, float(steps), float(steps))
        master, watch = Master(units, connections, iterated, timeline, **rest), _Watch()
        master.run([watch])
        return master, watch.steps

    return run


def _chain(fake: Any, port: Any, laws: Mapping[str, Callable[[Any], Any]]) -> dict[str, Any]:
    """Units in a ring, each with the law by which its output x<name> follows that of the one before."""
    names = list(laws)
    units = {}
    for before, name in zip([names[-1], *names], names, strict=False):

        def law(given: Any, *_: Any, name: str = name, before: str = before) -> dict[str, Any]:
            return {f"x{name}": laws[name](given[f"x{before}"])}

        units[name] = fake(name, [port(f"x{before}")], [port(f"x{name}")], law=law)
    return units


# --- nothing has arrived yet --------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [("a", "b", "c"), ("c", "b", "a")])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("named", ["a.xa", "b.xb", "c.xc"])
def test_a_small_signal_on_a_large_constant_comes_round(
    named: str, scheme: str, order: Sequence[str], fake: Any, port: Any, solve: Solve
) -> None:
    # x = 0.5 z + 1, which b carries as 1e6 + x: its changes are next to nothing of that.
    units = _chain(fake, port, {"a": lambda z: 0.5 * z + 1.0, "b": lambda x: 1e6 + x, "c": lambda y: y - 1e6})
    criteria = {"b.xb": Criterion(relative=1e-11)} if named == "b.xb" else {named: Criterion(relative=1e-5)}
    master, _ = solve(units, criteria, scheme, order=order)
    for unit, value in (("a", 2.0), ("c", 2.0)):
        assert float(master.exchange.value(unit, f"x{unit}")) == pytest.approx(value, rel=1e-4), unit


def test_a_threshold_that_a_small_change_passes_is_noticed(fake: Any, port: Any, solve: Solve) -> None:
    # From 1 to 1.0001 the output of b goes from 0 to 1; the change of x is smaller than its criterion.
    laws = {
        "a": lambda z: 1.00005 + 1e-5 * z,
        "b": lambda x: np.clip(1e4 * (x - 1.0), 0.0, 1.0),
        "c": lambda y: y,
    }
    values = []
    for scheme in ("jacobi", "gauss-seidel"):
        units = _chain(fake, port, laws)
        units["a"]._take({"xa": 1.0})
        master, _ = solve(units, {"a.xa": Criterion(relative=1e-3), "c.xc": Criterion(relative=1e-3)}, scheme)
        values.append(float(master.exchange.value("c", "xc")))
    # y = 0.5 + 0.1 y.
    np.testing.assert_allclose(values, 0.5 / 0.9, rtol=2e-3)


@pytest.mark.parametrize(
    ("scheme", "acceleration"),
    # Without Aitken's relaxation under Jacobi, where one factor for all fields fails.
    [*product(["gauss-seidel"], _ACCELERATIONS), *product(["jacobi"], ["none", "relaxation", "anderson"])],
)
@pytest.mark.parametrize("named", ["a.xa", "b.xb", "c.xc"])
@pytest.mark.parametrize(
    "criterion", [Criterion(residual_relative=1e-8), Criterion(absolute=1e-8), Criterion(relative=1e-8)]
)
def test_every_measure_of_every_field_finds_the_solution(
    acceleration: str, criterion: Criterion, named: str, scheme: str, fake: Any, port: Any, solve: Solve
) -> None:
    units = _chain(fake, port, {"a": lambda z: 0.5 * z + 1.0, "b": lambda x: x, "c": lambda y: y})
    master, (*_, step) = solve(units, {named: criterion}, scheme, _ACCELERATIONS[acceleration]())
    assert step.sweeps.converged
    for unit in "abc":
        assert float(master.exchange.value(unit, f"x{unit}")) == pytest.approx(2.0, rel=1e-6)


def test_the_first_residual_is_the_largest_of_the_first_round() -> None:
    criterion, values = Criterion(residual_relative=0.1), {"a.x": np.array(10.0)}

    def sweeps(*residuals: float) -> list[bool]:
        convergence = Convergence({"a.x": criterion}, ["a.x"], round_sweeps=2)
        return [convergence.judge({"a.x": np.array(residual)}, values) for residual in residuals]

    # Nothing had arrived in the first sweep. Of the round's two sweeps both have to be small.
    assert sweeps(1e-20, 1.0, 0.09, 0.05) == [False, False, False, True]
    assert sweeps(1e-20, 1.0, 0.11, 0.09, 0.11, 0.09, 0.09) == [False] * 6 + [True]
    # What changes nothing at all needs no second look.
    assert sweeps(1.0, 0.0) == [False, True]
    assert sweeps(0.0) == [True]


def test_a_field_that_has_not_moved_does_not_ask_the_impossible_of_others() -> None:
    still = Criterion(residual_relative=1e-4)
    assert still.for_others(magnitude=5.0, first=0.0) == 1e-4
    assert still.for_others(magnitude=5.0, first=1.0) == pytest.approx(2e-5)


# --- what else may lie in a loop ----------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_an_element_that_closes_a_loop_is_judged(scheme: str, fake: Any, port: Any, solve: Solve) -> None:
    units = {
        "a": fake(
            "a",
            [port("u")],
            [port("y", shape=(3,))],
            law=lambda given, *_: {"y": np.array([7.0, 0.5 * given["u"] + 1.0, 9.0])},
        ),
        "b": fake("b", [port("w")], [port("v")], law=lambda given, *_: {"v": given["w"]}),
    }
    written = ["a.y[2] -> b.w", "b.v -> a.u"]
    for named in ("a.y[2]", "b.v"):
        master, (*_, step) = solve(units, {named: Criterion(relative=1e-9)}, scheme, written=written)
        assert set(step.sweeps.residuals) == {"a.y[2]", "b.v"}
        assert float(master.exchange.value("b", "v")) == pytest.approx(2.0, rel=1e-8)


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_a_law_that_carries_nothing_closes_no_loop_and_keeps_none_open(
    scheme: str, fake: Any, port: Any, solve: Solve
) -> None:
    units = {
        "a": fake("a", [port("u")], [port("y")], law=lambda given, *_: {"y": 3.0 * given["u"] + 1.0}),
        "b": fake("b", [port("w")], [port("v")], law=lambda given, *_: {"v": given["w"]}),
    }
    written = ["a.y -> b.w", "b.v * 0 -> a.u"]
    master, (*_, step) = solve(units, {"a.y": Criterion(relative=1e-9)}, scheme, written=written)
    assert step.sweeps.iterations <= 3
    assert float(master.exchange.value("b", "v")) == 1.0


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_units_that_wait_and_units_without_memory_are_no_excuse(
    scheme: str, fake: Any, port: Any, solve: Solve
) -> None:
    ends = {}
    for every in (1, 2):
        units = _chain(fake, port, {"a": lambda z: 0.5 * z + 1.0, "b": lambda x: x, "c": lambda y: y})
        units["b"].memoryless = True
        master, steps = solve(units, {"c.xc": Criterion(relative=1e-9)}, scheme, steps=4, every={"c": every})
        # Without c there is no loop to iterate.
        waits = [bool(step.waiting) for step in steps[1:]]
        assert waits == ([False] * 4 if every == 1 else [True, False] * 2)
        ends[every] = float(master.exchange.value("a", "xa"))
    assert ends[1] == pytest.approx(ends[2], rel=1e-8) == pytest.approx(2.0, rel=1e-8)


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_a_start_that_looks_like_the_solution_is_none(scheme: str, fake: Any, port: Any, solve: Solve) -> None:
    # All values are those extrapolated, but the unit that has changed its mind: a drive that sets in at the third step.
    def driven(given: Any, outputs: Any, time: float, size: float) -> dict[str, Any]:
        return {"xa": 0.5 * given["xc"] + (1.0 if time > 1.5e-3 else 0.0)}

    units = _chain(fake, port, {"a": lambda z: z, "b": lambda x: x, "c": lambda y: y})
    units["a"].law = driven
    master, steps = solve(units, {"c.xc": Criterion(relative=1e-9)}, scheme, steps=4)
    assert [step.sweeps.iterations for step in steps[1:3]] == [1, 1]
    assert float(master.exchange.value("c", "xc")) == pytest.approx(2.0, rel=1e-7)


# --- numbers off the scale ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_what_diverges_beyond_all_squares_has_not_converged(scheme: str, fake: Any, port: Any, solve: Solve) -> None:
    units = _chain(fake, port, {"a": lambda z: 1.0 - 30.0 * z, "b": lambda x: x})
    with pytest.raises(RunError, match="no convergence in"):
        solve(units, {"b.xb": Criterion(relative=0.5)}, scheme, limit=200)


def test_tiny_fields_converge_by_their_own_measure(fake: Any, port: Any, solve: Solve) -> None:
    units = _chain(fake, port, {"a": lambda z: 0.5 * z + 1e-200, "b": lambda x: x})
    master, (*_, step) = solve(units, {"b.xb": Criterion(relative=1e-9)})
    assert step.sweeps.iterations > 10
    assert float(master.exchange.value("b", "xb")) == pytest.approx(2e-200, rel=1e-8)


@pytest.mark.parametrize("scale", [1e-300, 1e-150, 1.0, 1e150, 1e300])
def test_the_norm_knows_no_overflow(scale: float) -> None:
    assert norm(np.array([[3.0, 0.0], [0.0, -4.0]]) * scale) == pytest.approx(5.0 * scale, rel=1e-14)
    assert norm(np.array(-2.0) * scale) == pytest.approx(2.0 * scale, rel=1e-14)
    assert norm(np.zeros(3)) == norm(np.zeros(0)) == 0.0
    assert not Criterion(relative=1.0).met(np.inf, np.inf, np.inf)


# --- a heart ------------------------------------------------------------------------------------------------------


def test_all_criteria_accelerations_and_schemes_agree_on_a_heart(small_scenario: Path, tmp_path: Path) -> None:
    def volume(scheme: str, acceleration: str, criterion: str) -> np.ndarray:
        iterate = f"{{acceleration: {acceleration}, max_iterations: 100, converge: {{{criterion}}}}}"
        linear = ["coupling.interpolation=linear", "coupling.extrapolation=1", "coupling.step_ms=5", "run.stop_ms=25"]
        scenario = load_scenario(small_scenario, [f"coupling.iterate={iterate}", *linear, f"coupling.scheme={scheme}"])
        outcome = run_scenario(scenario, tmp_path, tmp_path / f"{scheme} {acceleration} {criterion}")
        return np.genfromtxt(outcome.folder / "timeseries.csv", delimiter=",", names=True)["lv_volume_ml"]

    expected = volume("gauss-seidel", "anderson", "stretch: {relative: 1e-9}, potential: {relative: 1e-9}")
    assert np.ptp(expected) > 0.1
    ways = zip(
        (*product(("jacobi", "gauss-seidel"), _ACCELERATIONS), ("jacobi", "none")),
        (
            "stretch: {residual-relative: 1e-5}",
            "potential: {residual-relative: 1e-5}",
            "active_stress: {residual-relative: 1e-5}",
            "stretch: {absolute: 1e-4}",
            "potential: {absolute: 1e-3}",
            "active_stress: {relative: 1e-6}",
            "potential: {relative: 1e-6}",
            "stretch: {relative: 1e-6}",
            "active_stress: {absolute: 1e-4}",
        ),
        strict=True,
    )
    for (scheme, acceleration), criterion in ways:
        found = volume(scheme, acceleration, criterion)
        np.testing.assert_allclose(found, expected, atol=2e-4, err_msg=f"{scheme}, {acceleration}, {criterion}")
