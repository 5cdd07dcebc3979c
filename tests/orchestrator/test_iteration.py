"""If this failed, iterated coupling would stop too early, never, or at values that are no solution of the loop."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.acceleration import Acceleration, Aitken, Anderson, Relaxation
from cardiac_cosim.orchestrator.coupling.connections import Connection, connect
from cardiac_cosim.orchestrator.coupling.convergence import Convergence, Criterion
from cardiac_cosim.orchestrator.coupling.exchange import Inputs
from cardiac_cosim.orchestrator.coupling.iteration import Iterated, Limits
from cardiac_cosim.orchestrator.coupling.master import Accepted, Master
from cardiac_cosim.orchestrator.coupling.schemes import SCHEMES
from cardiac_cosim.orchestrator.coupling.timeline import Timeline
from cardiac_cosim.orchestrator.errors import RunError
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario


class _Watch:
    def __init__(self) -> None:
        self.steps: list[Accepted] = []

    def accept(self, step: Accepted, exchange: Any) -> None:
        self.steps.append(step)


@pytest.fixture
def loop(fake: Any, port: Any) -> Callable[..., dict[str, Any]]:
    """Two units with y = G x + b and x = y, at once: an algebraic loop whose solution is (1 − G)⁻¹ b."""

    def make(gain: Any, offset: Any = 1.0) -> dict[str, Any]:
        matrix, constant = np.atleast_2d(gain).astype(float), np.atleast_1d(offset).astype(float)
        x, y = port("x", shape=constant.shape), port("y", shape=constant.shape)
        return {
            "a": fake("a", [x], [y], law=lambda inputs, *_: {"y": matrix @ inputs["x"] + constant}),
            "b": fake("b", [y], [x], law=lambda inputs, *_: {"x": inputs["y"]}),
        }

    return make


def _run(
    units: dict[str, Any],
    scheme: str = "gauss-seidel",
    acceleration: Acceleration | None = None,
    steps: int = 1,
    limit: int = 50,
    tolerance: float = 1e-10,
    fail: bool = True,
) -> tuple[Master, list[Accepted]]:
    connections: tuple[Connection, ...] = connect(units, [])
    # Under Gauss–Seidel one value is carried from sweep to sweep, under Jacobi both are.
    carried = ("b.x",) if scheme == "gauss-seidel" else ("a.y", "b.x")
    criteria = {name: Criterion(absolute=tolerance) for name in carried}
    limits = Limits(criteria, limit, fail)
    iterated = Iterated(SCHEMES[scheme](), units, connections, acceleration or Relaxation(1.0), limits)
    timeline = Timeline.of_fixed_step(1.0, float(steps), 1.0)
    master, watch = Master(units, connections, iterated, timeline), _Watch()
    master.run([watch])
    return master, watch.steps


@pytest.mark.parametrize("gain", [-0.9, -0.5, 0.3, 0.8])
@pytest.mark.parametrize(("scheme", "power"), [("gauss-seidel", 1.0), ("jacobi", 0.5)])
def test_a_scalar_loop_contracts_by_its_gain(loop: Any, gain: float, scheme: str, power: float) -> None:
    master, (_, step) = _run(loop(gain), scheme, limit=500)
    history = [sweep["b.x"] for sweep in step.sweeps.loops[0].history]
    # Under Jacobi the two values take turns: the rate shows over two sweeps.
    shrunk = [late / early for early, late in zip(history, history[2:], strict=False) if late > 1e-8]
    assert len(shrunk) > 5
    np.testing.assert_allclose(np.sqrt(shrunk), abs(gain) ** power, rtol=1e-6)
    assert step.sweeps.contraction_rate == pytest.approx(abs(gain) ** power, rel=0.1)
    assert master.exchange.value("b", "x") == pytest.approx(1.0 / (1.0 - gain), rel=1e-8)


@pytest.mark.parametrize("gain", [-3.0, -0.5, 0.5])
def test_relaxation_converges_up_to_its_limit_and_not_beyond(loop: Any, gain: float) -> None:
    limit = 2.0 / (1.0 - gain)
    master, (_, step) = _run(loop(gain), acceleration=Relaxation(0.9 * limit), limit=500)
    assert master.exchange.value("b", "x") == pytest.approx(1.0 / (1.0 - gain), rel=1e-8)
    with pytest.raises(RunError, match="no convergence in 200 sweeps"):
        _run(loop(gain), acceleration=Relaxation(1.1 * limit), limit=200)
    _, (_, best) = _run(loop(gain), acceleration=Relaxation(1.0 / (1.0 - gain)))
    # At the best factor the second iterate is exact.
    assert best.sweeps.iterations == 2
    assert step.sweeps.iterations > 10


@pytest.mark.parametrize("gain", [-3.0, -30.0, 1.5, 0.99])
def test_aitken_needs_three_evaluations_of_a_scalar_loop(loop: Any, gain: float) -> None:
    master, (_, step) = _run(loop(gain), acceleration=Aitken(0.5))
    assert step.sweeps.iterations <= 3
    assert master.exchange.value("b", "x") == pytest.approx(1.0 / (1.0 - gain), rel=1e-8)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("gain", [-3.0, 1.5])
def test_anderson_needs_a_handful_where_the_plain_iteration_diverges(loop: Any, gain: float, scheme: str) -> None:
    with pytest.raises(RunError, match="the residual changes by a factor of"):
        _run(loop(gain), scheme, limit=30)
    master, (_, step) = _run(loop(gain), scheme, Anderson(0.1))
    assert step.sweeps.iterations <= 6
    assert master.exchange.value("b", "x") == pytest.approx(1.0 / (1.0 - gain), rel=1e-8)


@pytest.mark.parametrize("size", [2, 3, 5])
def test_anderson_solves_a_linear_loop_in_as_many_sweeps_as_it_has_unknowns(loop: Any, size: int) -> None:
    random = np.random.default_rng(size)
    gain, offset = random.normal(size=(size, size)), random.normal(size=size)
    # As many differences as unknowns have to be seen, one sweep more is exact; the filter is not to lose any of them.
    master, (_, step) = _run(loop(gain, offset), acceleration=Anderson(0.1, filter_limit=1e-12), tolerance=1e-9)
    assert step.sweeps.iterations <= size + 3
    expected = np.linalg.solve(np.eye(size) - gain, offset)
    np.testing.assert_allclose(master.exchange.value("b", "x"), expected, rtol=1e-6)


def test_columns_of_earlier_steps_save_sweeps(loop: Any) -> None:
    random = np.random.default_rng(1)
    gain, offset = 0.9 * random.normal(size=(6, 6)), random.normal(size=6)

    def sweeps(reused: int) -> int:
        units, time = loop(gain, offset), [0.0]

        def moving(inputs: Any, outputs: Any, begin: float, size: float) -> dict[str, Any]:
            time[0] = begin + size
            return {"y": gain @ inputs["x"] + offset * np.cos(1e3 * time[0])}

        units["a"].law = moving
        _, steps = _run(units, acceleration=Anderson(0.1, reused_steps=reused, filter_limit=1e-8), steps=6)
        return sum(step.sweeps.iterations for step in steps[2:])

    assert sweeps(8) < sweeps(0)


@pytest.mark.parametrize("acceleration", [Relaxation(1.0), Aitken(0.5), Anderson(0.1)])
def test_a_loop_that_stands_still_takes_one_sweep_a_step(loop: Any, acceleration: Acceleration) -> None:
    master, steps = _run(loop(0.0, 0.0), acceleration=acceleration, steps=3)
    assert [step.sweeps.iterations for step in steps[1:]] == [1, 1, 1]
    assert master.exchange.value("b", "x") == 0.0


@pytest.mark.parametrize("acceleration", [Relaxation(1.0), Aitken(0.5), Anderson(0.1)])
def test_accelerations_survive_residuals_of_zero(acceleration: Acceleration) -> None:
    zero, one = np.zeros(3), np.ones(3)
    acceleration.begin()
    for residual in (one, one, zero, zero, one):
        following = acceleration.next(one, residual)
        assert np.isfinite(following).all()


def test_convergence_is_what_the_criterion_says_and_not_the_count(loop: Any) -> None:
    _, (_, step) = _run(loop(0.5))
    needed = step.sweeps.iterations
    # Exactly as many sweeps as needed: reached with the last one, so it counts.
    _, (_, last) = _run(loop(0.5), limit=needed)
    assert last.sweeps.iterations == needed
    with pytest.raises(RunError, match=rf"no convergence in {needed - 1} sweeps: .*b\.x \(largest at index 0:"):
        _run(loop(0.5), limit=needed - 1)
    _, (_, tolerated) = _run(loop(0.5), limit=needed - 1, fail=False)
    assert not tolerated.sweeps.converged
    assert last.sweeps.converged
    assert tolerated.sweeps.loops[0].history[-1]["b.x"] > 1e-10


def test_units_outside_the_loop_step_once_and_in_its_order(loop: Any, fake: Any, port: Any) -> None:
    units = loop(0.5)
    units["after"] = fake("after", [port("x")], [port("z")], law=lambda inputs, *_: {"z": 2.0 * inputs["x"][0]})
    units["after"].inputs["x"] = units["b"].outputs["x"]
    units["after"]._in["x"] = np.zeros(1)
    units["before"] = fake("before", outputs=[port("w")], law=lambda *_: {"w": 1.0})
    master, steps = _run(units, steps=2)
    # In the second step the loop is where it was: one sweep shows that.
    assert steps[1].sweeps.iterations > 10
    assert steps[2].sweeps.iterations == 1
    for name in ("before", "after"):
        assert [call[1] for call in units[name].calls].count("step") == 2
        assert "restore" not in [call[1] for call in units[name].calls]
    # It saw the loop's last value, not one on the way there.
    assert float(master.exchange.value("after", "z")) == pytest.approx(4.0, rel=1e-8)


def test_every_sweep_starts_where_the_step_began_and_states_are_given_up(loop: Any) -> None:
    units = loop(0.5)
    _run(units, steps=3)
    for unit in units.values():
        calls = [call[1] for call in unit.calls]
        assert calls.count("restore") == calls.count("step") - 3
        assert calls.count("save") == calls.count("free") == 3
    diverging = loop(2.0)
    with pytest.raises(RunError):
        _run(diverging, limit=10)
    for unit in diverging.values():
        calls = [call[1] for call in unit.calls]
        assert calls.count("save") == calls.count("free") == 1


@pytest.mark.parametrize(
    ("criterion", "limit"),
    [
        (Criterion(absolute=0.5), 0.5),
        (Criterion(relative=0.01), 0.01 * 20.0),
        (Criterion(residual_relative=0.1), 0.1 * 4.0),
        (Criterion(absolute=0.3, relative=0.02), 0.02 * 20.0),
    ],
)
def test_measures_on_both_sides_of_their_limits(criterion: Criterion, limit: float) -> None:
    assert criterion.met(0.999 * limit, value=20.0, first=4.0)
    assert not criterion.met(1.001 * limit, value=20.0, first=4.0)


@pytest.mark.parametrize(
    ("criterion", "limit"),
    [
        (Criterion(relative=0.2), 0.2),
        # 4e-4 of a field of 2 are two in ten thousand; a tenth of a first residual of 1 is more than three digits.
        (Criterion(absolute=4e-4), 2e-4),
        (Criterion(residual_relative=0.1), 1e-3),
        (Criterion(absolute=4e-4, relative=0.2), 0.2),
    ],
)
def test_a_field_that_sweeps_start_from_is_judged_by_the_criteria_of_the_others(
    criterion: Criterion, limit: float
) -> None:
    def judged(residual: float, carried: list[str]) -> bool:
        convergence = Convergence({"a.y": criterion}, carried)
        values = {"a.y": np.array([2.0]), "b.x": np.array([3.0, 4.0])}
        convergence.judge({"a.y": np.ones(1), "b.x": np.ones(2)}, values)
        return convergence.judge({"a.y": np.zeros(1), "b.x": np.array([residual, 0.0])}, values)

    # Its magnitude over the step is 5, the norm of (3, 4).
    assert judged(0.99 * limit * 5.0, ["b.x"])
    assert not judged(1.01 * limit * 5.0, ["b.x"])
    # One that is computed anew in every sweep is measured only.
    assert judged(1e9, [])


@pytest.mark.parametrize("named", ["a.x", "b.y", "c.z"])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_a_loop_is_not_accepted_before_a_change_has_come_round(named: str, scheme: str, fake: Any, port: Any) -> None:
    # x = 0.5 z + 1 jumps in the first sweep, and y = x, z = y hear of it one sweep later each.
    units = {
        "a": fake("a", [port("z")], [port("x")], law=lambda given, *_: {"x": 0.5 * given["z"] + 1.0}),
        "b": fake("b", [port("x")], [port("y")], law=lambda given, *_: {"y": given["x"]}),
        "c": fake("c", [port("y")], [port("z")], law=lambda given, *_: {"z": given["y"]}),
    }
    connections = connect(units, [])
    limits = Limits({named: Criterion(relative=1e-8)}, 200, True)
    iterated = Iterated(SCHEMES[scheme](), units, connections, Relaxation(1.0), limits)
    master = Master(units, connections, iterated, Timeline.of_fixed_step(1.0, 1.0, 1.0))
    master.run([])
    for unit, name in (("a", "x"), ("b", "y"), ("c", "z")):
        assert float(master.exchange.value(unit, name)) == pytest.approx(2.0, rel=1e-6)


def test_both_schemes_agree_on_a_heart_whatever_field_is_named(small_scenario: Path, tmp_path: Path) -> None:
    def volume(scheme: str, field: str) -> np.ndarray:
        iterate = f"coupling.iterate={{acceleration: anderson, converge: {{{field}: {{relative: 1e-6}}}}}}"
        linear = ["coupling.interpolation=linear", "coupling.extrapolation=1", "coupling.step_ms=5", "run.stop_ms=40"]
        scenario = load_scenario(small_scenario, [iterate, *linear, f"coupling.scheme={scheme}"])
        outcome = run_scenario(scenario, tmp_path, tmp_path / f"{scheme} {field}")
        return np.genfromtxt(outcome.folder / "timeseries.csv", delimiter=",", names=True)["lv_volume_ml"]

    expected = volume("gauss-seidel", "stretch")
    assert np.ptp(expected) > 1.0
    for scheme, field in (("jacobi", "stretch"), ("jacobi", "potential"), ("gauss-seidel", "active_stress")):
        np.testing.assert_allclose(volume(scheme, field), expected, atol=2e-3, err_msg=f"{scheme}, {field}")


# --- values that change at events ---------------------------------------------------------------------------------


def _switched(fake: Any, port: Any, closes: Callable[[float], bool]) -> dict[str, Any]:
    """y = 0.6 + 0.3 on, and `on` by what a relay `closes` at."""

    def level(given: Any, *_: Any) -> dict[str, Any]:
        return {"y": 0.6 + 0.3 * float(given["on"])}

    def relay(given: Any, *_: Any) -> dict[str, Any]:
        return {"on": closes(float(given["y"]))}

    on = port("on", type="Boolean", discrete=True)
    return {
        "a": fake("a", [on], [port("y")], law=level, initially=lambda given: {"y": 0.6}),
        "b": fake("b", [port("y")], [on], law=relay),
    }


@pytest.mark.parametrize("acceleration", [Relaxation(1.0), Aitken(0.5), Anderson(0.1)])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_a_loop_with_a_switch_has_converged_when_that_rests(
    scheme: str, acceleration: Acceleration, fake: Any, port: Any
) -> None:
    units = _switched(fake, port, lambda y: y > 0.5)
    connections = connect(units, [])
    limits = Limits({"a.y": Criterion(relative=1e-9)}, 60, True)
    iterated = Iterated(SCHEMES[scheme](), units, connections, acceleration, limits)
    master = Master(units, connections, iterated, Timeline.of_fixed_step(1.0, 1.0, 1.0))
    master.run([])
    assert float(master.exchange.value("a", "y")) == pytest.approx(0.9, rel=1e-8)
    assert float(master.exchange.value("b", "on")) == 1.0


def test_a_switch_that_never_rests_is_no_convergence(fake: Any, port: Any) -> None:
    units = _switched(fake, port, lambda y: y < 0.7)
    connections = connect(units, [])
    limits = Limits({"a.y": Criterion(relative=10.0)}, 20, True)
    iterated = Iterated(SCHEMES["gauss-seidel"](), units, connections, Relaxation(1.0), limits)
    with pytest.raises(RunError, match=r"no convergence in 20 sweeps: b\.on"):
        Master(units, connections, iterated, Timeline.of_fixed_step(1.0, 1.0, 1.0)).run([])


# --- initial values -----------------------------------------------------------------------------------------------


def _feedthrough(fake: Any, port: Any, late: bool = False) -> dict[str, Any]:
    """b.in = 0.5 a.out + 1, a.in = b.out, at once; where `late`, b's output follows only after the initialisation."""

    def half(given: Any, *_: Any) -> dict[str, Any]:
        return {"y": 0.5 * given["x"] + 1.0}

    def same(given: Any, *_: Any) -> dict[str, Any]:
        return {"x": given["y"]}

    units = {
        "a": fake("a", [port("x")], [port("y")], law=half, initially=half),
        "b": fake("b", [port("y")], [port("x")], law=same, initially=same),
    }
    if late:
        units["b"].initially = lambda given: same(given) if units["b"].calls[-1][1] == "complete" else {"x": 0.0}
    return units


@pytest.mark.parametrize("acceleration", [Relaxation(1.0), Anderson(1.0)])
def test_initial_values_of_an_iterated_loop_agree(
    acceleration: Acceleration, fake: Any, port: Any, master: Any
) -> None:
    units = _feedthrough(fake, port)
    _, (first, *_) = _run(units, acceleration=acceleration)
    assert first.sweeps.converged
    # It ended with the initial values, not with those of the step after: both are at their solution from the begin on.
    before = [call for call in units["b"].calls[: units["b"].calls.index(("b", "complete"))] if call[1] == "set"]
    assert before[-1][3] == pytest.approx(2.0, abs=1e-9)
    explicit = master(_feedthrough(fake, port))
    explicit.initialise()
    assert [float(explicit.exchange.value(unit, name)) for unit, name in (("a", "y"), ("b", "x"))] == [1.0, 1.0]


def test_ramps_of_the_first_step_begin_at_the_initial_values_in_every_sweep(fake: Any, port: Any) -> None:
    # x follows y within the step and y follows x: the end of a ramp moves from sweep to sweep, its begin does not.
    units = {
        "a": fake("a", [port("x")], [port("y")], law=lambda given, *_: {"y": 0.5 * given["x"] + 1.0}, ramps=True),
        "b": fake("b", [port("y")], [port("x")], law=lambda given, *_: {"x": given["y"]}, begins={"x": 0.25}),
    }
    connections = connect(units, [])
    limits = Limits({"b.x": Criterion(absolute=1e-6)}, 50, True)
    iterated = Iterated(SCHEMES["gauss-seidel"](), units, connections, Relaxation(1.0), limits)
    time = Timeline.of_fixed_step(1.0, 1.0, 1.0)
    Master(units, connections, iterated, time, inputs=Inputs(1, linear=True)).run([])
    ramps = [call[3:] for call in units["a"].calls if call[1] == "ramp"]
    assert len(ramps) > 5
    assert {begin for begin, _ in ramps} == {0.25}
    assert len({end for _, end in ramps}) == len(ramps)


def test_outputs_that_follow_only_after_the_initialisation_are_no_agreement(fake: Any, port: Any) -> None:
    _, (first, *_) = _run(_feedthrough(fake, port, late=True))
    assert not first.sweeps.converged


def test_a_loop_without_initial_values_fails_at_the_initialisation(fake: Any, port: Any) -> None:
    units = _feedthrough(fake, port)
    units["a"].initially = lambda given: {"y": 1.0 - 3.0 * given["x"]}
    with pytest.raises(
        RunError, match=r"^the coupling failed during initialisation: no convergence in 50 sweeps: b\.x"
    ):
        _run(units)


# --- failures -----------------------------------------------------------------------------------------------------


def test_the_sweeps_of_a_step_that_fails_are_kept(loop: Any) -> None:
    with pytest.raises(RunError) as failure:
        _run(loop(2.0), limit=7)
    assert failure.value.time_ms == 1.0
    norms = [sweep["b.x"] for sweep in failure.value.sweeps.loops[0].history]
    assert len(norms) == 7
    assert norms == sorted(norms)


def test_a_loop_that_fails_says_when_and_that_earlier_results_stand(loop: Any) -> None:
    units = loop(0.5)
    law = units["a"].law
    # From the second step on no sweep agrees with the one before it.
    count = iter(range(1000))
    units["a"].law = lambda inputs, outputs, time, size: (
        law(inputs, outputs, time, size) if time == 0.0 else {"y": np.array([float(next(count))])}
    )
    with pytest.raises(RunError, match=r"^the coupling failed in the step from 1 to 2 ms: .* up to 1 ms are complete"):
        _run(units, steps=3)


def test_an_iteration_that_leaves_the_numbers_is_a_failure_of_the_coupling(loop: Any) -> None:
    with pytest.raises(
        RunError, match=r"^the coupling failed in the step from 0 to 1 ms: no convergence in 1 sweeps: b\.x"
    ):
        _run(loop(0.5), acceleration=Relaxation(np.inf))
