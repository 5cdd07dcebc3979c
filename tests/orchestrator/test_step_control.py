"""If these fail, adaptive steps drift off the output times, refused steps leave traces, or units skip their turns."""

from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.connections import connect
from cardiac_cosim.orchestrator.coupling.exchange import Exchange, Inputs
from cardiac_cosim.orchestrator.coupling.master import Accepted, Master
from cardiac_cosim.orchestrator.coupling.missed_tolerance import Missed
from cardiac_cosim.orchestrator.coupling.schemes import SCHEMES, GaussSeidel
from cardiac_cosim.orchestrator.coupling.step_control import AdaptiveStep, FixedStep, Verdict
from cardiac_cosim.orchestrator.coupling.timeline import Timeline
from cardiac_cosim.orchestrator.errors import (
    ParticipantError,
    ParticipantLost,
    ParticipantTerminated,
    RunError,
    Terminated,
)
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario


class _Watch:
    def __init__(self) -> None:
        self.steps: list[Accepted] = []

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        self.steps.append(step)


class _RefusesOnce(FixedStep):
    """Refuses every step once."""

    refuses = True

    def __init__(self) -> None:
        self._again = False

    def judge(self, exchange: Exchange, ticks: int) -> Verdict:
        self._again = not self._again
        return Verdict(not self._again)


# --- the time axis ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("every", [0.1, 0.3, 1.0 / 3.0, 5.0])
@pytest.mark.parametrize("shortest", [0.01, 0.07, 0.5])
def test_output_times_are_hit_to_the_last_digit(every: float, shortest: float) -> None:
    time = Timeline.of_shortest_step(shortest, 1000 * every, every)
    assert time.tick_ms <= shortest / 8 * (1 + 1e-12)
    for output in (1, 7, 999, 1000):
        assert time.time_ms(output * time.every) == float(output * Fraction(repr(every)))
        assert time.is_output(output * time.every)
    assert time.stop == 1000 * time.every
    assert not time.is_output(time.every + 1)


@pytest.mark.parametrize("step", ["0.1", "0.3", "0.7", "1e-3", "2.5"])
def test_times_are_the_decimals_a_person_would_write(step: str) -> None:
    fixed = Timeline.of_fixed_step(float(step), 5000 * float(step), 10 * float(step))
    shortest = Timeline.of_shortest_step(float(step), 5000 * float(step), 10 * float(step))
    for tick in range(5001):
        written = float(Decimal(step) * tick)
        assert fixed.time_ms(tick) == written
        if tick % 10 == 0:
            assert shortest.time_ms(tick // 10 * shortest.every) == written
    assert fixed.size_ms(1) == float(step)


def test_a_step_that_is_no_decimal_ends_at_the_outputs_and_the_end_as_written() -> None:
    thirds = Timeline.of_fixed_step(1.0 / 3.0, 7.0, 2.0)
    assert [thirds.time_ms(tick) for tick in (6, 12, 21)] == [2.0, 4.0, 7.0]
    assert thirds.time_ms(1) == thirds.size_ms(1) == 1.0 / 3.0


# --- refused steps ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "coupling",
    [
        "scheme: gauss-seidel",
        "scheme: jacobi, interpolation: linear, extrapolation: 2",
        "scheme: gauss-seidel, interpolation: linear, extrapolation: 1, "
        "iterate: {acceleration: anderson, converge: {stretch: {relative: 1e-4}}}",
    ],
)
@pytest.mark.parametrize("participants", ["native", "fmu"])
def test_a_run_with_every_step_refused_once_is_the_run_without(
    coupling: str, participants: str, small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def series(name: str) -> list[bytes]:
        sets = [f"coupling={{step_ms: 2.5, {coupling}}}", f"run.participants={participants}"]
        outcome = run_scenario(load_scenario(small_scenario, sets), tmp_path, tmp_path / name, fmu_dir=tmp_path)
        return [(outcome.folder / file).read_bytes() for file in ("timeseries.csv", "fields.h5")]

    plain = series("plain")
    monkeypatch.setattr("cardiac_cosim.orchestrator.coupling.build.FixedStep", _RefusesOnce)
    assert series("refused") == plain
    log = np.genfromtxt(tmp_path / "refused" / "coupling.csv", delimiter=",", names=True)
    assert (log["rejected"] == 1).all()


def test_a_unit_that_fails_in_a_long_step_is_given_a_shorter_one(fake: Any, port: Any) -> None:
    def law(given: Any, before: Any, time: float, size: float) -> Mapping[str, float]:
        if size > 1.3e-3:
            raise ParticipantError("too far for me")
        return {"x": float(before["x"]) + size}

    time = Timeline.of_shortest_step(0.5, 20.0, 10.0)
    units = {"a": fake("a", outputs=[port("x")], law=law), "b": fake("b", [port("x")])}
    watch = _Watch()
    control = AdaptiveStep(time, 1e6, 0.5, 10.0, 5.0, units)
    Master(units, connect(units, []), GaussSeidel(), time, inputs=Inputs(depth=2), control=control).run([watch])
    assert watch.steps[-1].time_ms == 20.0
    assert sum(step.rejected for step in watch.steps) >= 2
    assert max(step.size_ms for step in watch.steps) <= 1.3
    # Every state that was saved was given up.
    calls = [call[1] for call in units["a"].calls]
    assert calls.count("save") == calls.count("free")

    def hopeless(*_: Any) -> Mapping[str, float]:
        raise ParticipantError("never")

    units["a"].law = hopeless
    control = AdaptiveStep(time, 1e6, 0.5, 10.0, 5.0, units)
    with pytest.raises(RunError, match=r"unit 'a' failed in the step from 0 to 0\.5 ms: never"):
        Master(units, connect(units, []), GaussSeidel(), time, inputs=Inputs(depth=2), control=control).run([])


# --- adaptive steps -----------------------------------------------------------------------------------------------


def _decay(fake: Any, port: Any) -> dict[str, Any]:
    """y' = −y/τ with τ = 10 ms over two units, which a coupling of second order follows well once y is small."""

    def fall(end: Any, state: Any, time: float, size: float, begin: Any) -> Mapping[str, float]:
        return {"y": float(state["y"]) - 100.0 * size * 0.5 * float(begin["u"] + end["u"])}

    return {
        "a": fake("a", [port("u")], [port("y")], law=fall, begins={"y": 1.0}, ramps=True),
        "b": fake(
            "b", [port("y")], [port("u")], law=lambda given, *_: {"u": given["y"]}, begins={"u": 1.0}, memoryless=True
        ),
    }


def test_adaptive_steps_grow_with_the_calm_hit_outputs_and_keep_to_their_limits(fake: Any, port: Any) -> None:
    time = Timeline.of_shortest_step(0.1, 100.0, 25.0)
    units, watch = _decay(fake, port), _Watch()
    control = AdaptiveStep(time, 1e-3, 0.1, 12.0, 0.1, units)
    Master(units, connect(units, []), GaussSeidel(), time, inputs=Inputs(1, True, 2), control=control).run([watch])
    steps = watch.steps[1:]
    assert [step.time_ms for step in steps if step.is_output] == [25.0, 50.0, 75.0, 100.0]
    sizes = np.array([step.size_ms for step in steps])
    assert np.isclose(sizes.sum(), 100.0)
    assert sizes.max() <= 12.0
    assert sizes[-3:].mean() > 3.0 * sizes[2:10].mean()
    assert len(steps) < 150


def test_the_error_of_an_adaptive_run_follows_its_tolerance(fake: Any, port: Any) -> None:
    time = Timeline.of_shortest_step(0.01, 50.0, 50.0)
    errors, counts = [], []
    for tolerance in (1e-2, 1e-3, 1e-4):
        units, watch = _decay(fake, port), _Watch()
        control = AdaptiveStep(time, tolerance, 0.01, 50.0, 0.1, units)
        master = Master(units, connect(units, []), GaussSeidel(), time, inputs=Inputs(1, True, 2), control=control)
        master.run([watch])
        errors.append(abs(float(master.exchange.value("a", "y")) - np.exp(-5.0)))
        counts.append(len(watch.steps))
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]
    np.testing.assert_allclose(np.diff(np.log(counts)), 0.5 * np.log(10.0), atol=0.5)


def test_a_control_resumed_goes_on_as_it_would_have(fake: Any, port: Any) -> None:
    time = Timeline.of_shortest_step(0.1, 60.0, 20.0)

    def master() -> Master:
        units = _decay(fake, port)
        control = AdaptiveStep(time, 1e-3, 0.1, 12.0, 0.1, units)
        return Master(units, connect(units, []), GaussSeidel(), time, inputs=Inputs(1, True, 2), control=control)

    class Stop(_Watch):
        def __bool__(self) -> bool:
            return len(self.steps) > 20

    whole, watch, rest = _Watch(), Stop(), _Watch()
    master().run([whole])
    first, second = master(), master()
    first.run([watch], stop=watch)
    second.resume(first.memory())
    second.run([rest])
    times = [step.time_ms for step in (*watch.steps, *rest.steps)]
    assert times == [step.time_ms for step in whole.steps]


def _adaptive(
    units: dict[str, Any], stop_ms: float, tolerance: float, min_ms: float, scheme: str = "gauss-seidel", **rest: Any
) -> tuple[Master, _Watch]:
    """A run of adaptive steps, the first of them as short as possible."""
    time, watch = Timeline.of_shortest_step(min_ms, stop_ms, stop_ms), _Watch()
    control = AdaptiveStep(time, tolerance, min_ms, stop_ms, min_ms, units)
    inputs = rest.pop("inputs", Inputs(1, True, 2))
    master = Master(units, connect(units, []), SCHEMES[scheme](), time, inputs=inputs, control=control, **rest)
    master.run([watch])
    return master, watch


def _clock_into_integrator(fake: Any, port: Any, ramps: bool) -> dict[str, Any]:
    """y' = u with u = t in seconds: y(t) = t²/2; the integrator holds u at the step's end, unless it `ramps`."""

    def integrate(end: Any, state: Any, time: float, size: float, begin: Any = None) -> Mapping[str, float]:
        mean = end["u"] if begin is None else 0.5 * (begin["u"] + end["u"])
        return {"y": float(state["y"]) + size * float(mean)}

    return {
        "clock": fake("clock", outputs=[port("u")], law=lambda given, before, time, size: {"u": time + size}),
        "integrator": fake("integrator", [port("u")], [port("y")], law=integrate, ramps=ramps),
    }


def test_inputs_that_are_held_are_judged_by_what_holding_does_to_them(fake: Any, port: Any) -> None:
    # The clock is on its line, whatever the step; one step of 10 s, held, would end at 100 instead of 50.
    errors, steps = [], []
    for tolerance in (4e-2, 2e-2, 1e-2):
        units = _clock_into_integrator(fake, port, ramps=False)
        master, watch = _adaptive(units, 10_000.0, tolerance, 10.0)
        errors.append(float(master.exchange.value("integrator", "y")) - 50.0)
        steps.append(len(watch.steps))
        assert master.missed.steps == 0
    assert errors[0] < 5.0
    # Of first order: half the error for twice the steps.
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2.0, rtol=0.35)
    np.testing.assert_allclose(np.divide(steps[1:], steps[:-1]), 2.0, rtol=0.35)
    master, watch = _adaptive(_clock_into_integrator(fake, port, ramps=True), 10_000.0, 1e-2, 10.0)
    assert float(master.exchange.value("integrator", "y")) == pytest.approx(50.0, rel=1e-12)
    assert len(watch.steps) < min(steps) / 3


def test_a_tolerance_that_is_missed_at_the_shortest_step_is_counted(fake: Any, port: Any) -> None:
    master, watch = _adaptive(_clock_into_integrator(fake, port, ramps=False), 10_000.0, 1e-6, 100.0)
    assert float(master.exchange.value("integrator", "y")) > 50.1
    judged = watch.steps[2:]
    assert all(step.missed and step.error is not None and step.error > 1e3 for step in judged)
    assert master.missed == Missed(len(judged), judged[0].time_ms)


def test_a_step_that_was_too_long_by_what_was_known_only_then_is_not_counted(fake: Any, port: Any) -> None:
    # In its second step everything has moved by what it moved then: any tolerance is missed.
    units = _clock_into_integrator(fake, port, ramps=False)
    master, watch = _adaptive(units, 10_000.0, 2e-2, 100.0)
    assert [step.missed for step in watch.steps].count(True) >= 2
    assert master.missed == Missed()


def test_extrapolated_inputs_are_judged_by_what_they_were_and_not_by_the_line(fake: Any, port: Any) -> None:
    def error(scheme: str) -> float:
        units = _clock_into_integrator(fake, port, ramps=True)
        master, _ = _adaptive(units, 10_000.0, 1e-2, 1.0, scheme, inputs=Inputs(0, True, 2))
        return abs(float(master.exchange.value("integrator", "y")) - 50.0)

    # Under Jacobi without extrapolation the end of a ramp is the value of the step before.
    assert error("gauss-seidel") < 1e-9
    assert 1e-3 < error("jacobi") < 1.0


def test_a_refused_step_leaves_no_trace_in_the_scale_of_the_errors(fake: Any, port: Any) -> None:
    # A step longer than 2 ms overshoots a thousandfold, and is refused: the steps after it are those without it.
    def run(outlier: float) -> list[float]:
        def law(given: Any, before: Any, time: float, size: float) -> Mapping[str, float]:
            end = 1e3 * (time + size)
            return {"x": np.sin(end / 10.0) + (outlier if size > 2.1e-3 else 0.0)}

        units = {"a": fake("a", outputs=[port("x")], law=law), "b": fake("b", [port("x")], memoryless=True)}
        time, watch = Timeline.of_shortest_step(0.25, 30.0, 30.0), _Watch()
        control = AdaptiveStep(time, 0.1, 0.25, 4.0, 0.25, units)
        inputs = Inputs(1, True, 2)
        Master(units, connect(units, []), GaussSeidel(), time, inputs=inputs, control=control).run([watch])
        outliers = [step for step in watch.steps if step.rejected]
        assert outliers or not outlier
        return [step.error for step in watch.steps if step.error is not None]

    # If the outlier had widened the scale, errors after it would be a thousandth of these.
    assert np.median(run(1e3)) > 0.1 * np.median(run(0.0))


def test_a_unit_that_waits_is_not_judged_by_what_it_was(fake: Any, port: Any) -> None:
    def units() -> dict[str, Any]:
        return {
            "slow": fake("slow", [], [port("y")], law=lambda given, before, time, size: {"y": time + size}),
            "fast": fake("fast", [port("y")], [port("z")], law=lambda given, *_: {"z": given["y"]}, ramps=True),
        }

    _, often = _adaptive(units(), 1_000.0, 1e-2, 1.0)
    _, seldom = _adaptive(units(), 1_000.0, 1e-2, 1.0, every={"slow": 4})
    # On a line nothing is ever wrong, so that steps grow, however seldom the unit steps that gives it.
    assert len(seldom.steps) <= 2 * len(often.steps)


# --- units that fail, or end -------------------------------------------------------------------------------------


def _failing_master(fake: Any, port: Any, law: Any) -> Master:
    units = {"a": fake("a", outputs=[port("x")], law=law), "b": fake("b", [port("x")])}
    time = Timeline.of_shortest_step(0.5, 20.0, 10.0)
    control = AdaptiveStep(time, 1e6, 0.5, 10.0, 5.0, units)
    return Master(units, connect(units, []), GaussSeidel(), time, inputs=Inputs(depth=2), control=control)


def test_why_a_unit_failed_in_longer_steps_is_told_once_the_shortest_fails(fake: Any, port: Any) -> None:
    def law(given: Any, before: Any, time: float, size: float) -> Mapping[str, float]:
        raise ParticipantError("the valve is stuck" if size > 1e-3 else "no solution")

    with pytest.raises(RunError) as failure:
        _failing_master(fake, port, law).run([])
    text = str(failure.value)
    assert text.startswith("unit 'a' failed in the step from 0 to 0.5 ms: no solution; before that unit 'a' failed in ")
    assert text.count("the valve is stuck") == 1


def test_why_a_unit_failed_is_told_when_it_cannot_go_back_either(fake: Any, port: Any) -> None:
    def law(given: Any, before: Any, time: float, size: float) -> Mapping[str, float]:
        raise ParticipantError("the valve is stuck")

    master = _failing_master(fake, port, law)

    def refused(state: Any) -> None:
        raise ParticipantError("fmi2SetFMUstate failed")

    master.participants["a"].restore = refused  # type: ignore[method-assign]
    master.participants["a"].free = refused  # type: ignore[method-assign]
    with pytest.raises(RunError, match=r"fmi2SetFMUstate failed; before that unit 'a' failed .* the valve is stuck"):
        master.run([])


@pytest.mark.parametrize(("error", "kind"), [(ParticipantLost, RunError), (ParticipantTerminated, Terminated)])
def test_a_unit_that_is_gone_or_at_its_end_is_not_tried_again(error: Any, kind: Any, fake: Any, port: Any) -> None:
    def law(given: Any, before: Any, time: float, size: float) -> Mapping[str, float]:
        raise error("enough")

    master = _failing_master(fake, port, law)
    with pytest.raises(kind, match=r"unit 'a' .*enough"):
        master.run([])
    assert [call[1] for call in master.participants["a"].calls].count("step") == 1  # type: ignore[attr-defined]


# --- units that step less often -----------------------------------------------------------------------------------


def test_a_unit_is_stepped_every_so_many_exchanges_and_at_outputs(fake: Any, port: Any, master: Any) -> None:
    units = {
        "fast": fake("fast", [port("slow_x")], [port("x")], law=lambda given, before, time, size: {"x": time + size}),
        "slow": fake("slow", [port("x")], [port("slow_x")], law=lambda given, *_: {"slow_x": given["x"]}),
    }
    watch = _Watch()
    master(units, 10, step_ms=1.0, every_ms=5.0, every={"slow": 3}).run([watch])
    assert [call[2:] for call in units["fast"].calls if call[1] == "step"] == [
        (pytest.approx(n * 1e-3), 1e-3) for n in range(10)
    ]
    # After three exchanges, at the output after two more, and so on; each from where it was.
    taken = [(round(call[2] * 1e3), round(call[3] * 1e3)) for call in units["slow"].calls if call[1] == "step"]
    assert taken == [(0, 3), (3, 2), (5, 3), (8, 2)]
    # What it has not computed yet is held for the others.
    seen = [call[3] for call in units["fast"].calls if call[1] == "set"]
    np.testing.assert_allclose(seen, [0, 0, 0, 3e-3, 3e-3, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3], atol=1e-12)


def test_what_a_slow_unit_gives_is_extrapolated_between_its_steps(fake: Any, port: Any, master: Any) -> None:
    units = {
        "slow": fake("slow", [], [port("y")], law=lambda given, before, time, size: {"y": 1e3 * (time + size)}),
        "fast": fake("fast", [port("y")], [port("z")], law=lambda given, *_: {"z": given["y"]}),
    }
    master(units, 8, every_ms=8.0, every={"slow": 2}, inputs=Inputs(1)).run([])
    seen = [float(call[3]) for call in units["fast"].calls if call[1] == "set"][1:]
    # A line is extrapolated exactly as soon as two of its points are known.
    np.testing.assert_allclose(seen, [0, 2, 3, 4, 5, 6, 7, 8], atol=1e-12)


def test_a_heart_whose_mechanics_is_solved_every_second_exchange_is_near_the_one_solved_at_each(
    small_scenario: Path, tmp_path: Path
) -> None:
    def volume(name: str, *sets: str) -> np.ndarray:
        outcome = run_scenario(load_scenario(small_scenario, sets), tmp_path, tmp_path / name)
        series = np.genfromtxt(outcome.folder / "timeseries.csv", delimiter=",", names=True)
        return series["lv_volume_ml"]

    every = volume("every", "run.stop_ms=20")
    second = volume("second", "run.stop_ms=20", "units.mechanics.every=2")
    # At the exchanges between there is no volume, rather than an old one.
    assert np.isnan(second[[1, 3]]).all()
    assert np.isfinite(second[[0, 2, 4, 5]]).all()
    # At output times all have stepped.
    assert np.abs(every - second)[::5].max() < 0.03
