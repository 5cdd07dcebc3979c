"""If these fail, a run is not the run asked for: steps lost or doubled, units started without their input, or an end
that takes good results with it and does not say which unit was to blame."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.exchange import Exchange
from cardiac_cosim.orchestrator.coupling.master import Accepted, stepping_order
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError, RunError


class _Watch:
    def __init__(self, read: str | None = None) -> None:
        self.steps: list[Accepted] = []
        self._read = read

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        if self._read is not None:
            exchange.value(*self._read.split("."))
        self.steps.append(step)


def _fails_at(number: int, how: Exception | float) -> Callable[..., dict[str, Any]]:
    """A law that counts, and in the step with `number` raises `how` or puts it out."""

    def law(given: Any, before: Any, time: float, size: float) -> dict[str, Any]:
        count = round(time / size) + 1
        if count < number:
            return {name: float(count) for name in before}
        if isinstance(how, Exception):
            raise how
        return {name: [0.0, 0.0, how] if np.ndim(value) else how for name, value in before.items()}

    return law


def test_units_are_initialised_after_their_sources_and_each_completely(fake, port, master) -> None:
    calls: list[tuple[Any, ...]] = []
    units = {
        "last": fake("last", [port("x"), port("f")], [port("z")], calls=calls),
        "middle": fake("middle", [port("f")], [port("x")], calls=calls, begins={"x": 2.0}),
        "first": fake("first", [], [port("f", fixed=True)], calls=calls, begins={"f": 1.0}),
    }
    master(units, steps=0).run([])
    assert calls[:-4] == [
        ("first", "begin"),
        ("first", "complete"),
        ("middle", "begin"),
        ("middle", "set", "f", 1.0),
        ("middle", "complete"),
    ]
    assert (calls[-4], calls[-1]) == (("last", "begin"), ("last", "complete"))
    assert sorted(calls[-3:-1]) == [("last", "set", "f", 1.0), ("last", "set", "x", 2.0)]


@pytest.mark.parametrize(("step_ms", "steps"), [(0.1, 3000), (1.0 / 3.0, 960), (0.7, 1000)])
def test_no_step_is_lost_to_rounding(fake, port, master, step_ms: float, steps: int) -> None:
    unit = fake("a", outputs=[port("x")])
    watch = _Watch()
    master({"a": unit}, step_ms=step_ms, steps=steps).run([watch])
    assert [step.number for step in watch.steps] == list(range(steps + 1))
    times = np.array([step.time_ms for step in watch.steps])
    # Not the rounding of a sum: every time is right to its own last digits.
    np.testing.assert_allclose(times, np.arange(steps + 1) * step_ms, rtol=3e-16, atol=0)
    assert times[-1] == steps * step_ms
    asked = np.array([call[2:] for call in unit.calls if call[1] == "step"])
    assert len(asked) == steps
    np.testing.assert_allclose(asked[:, 0] * 1000.0, times[:-1], rtol=3e-16)
    assert set(asked[:, 1]) == {step_ms / 1000.0}


def test_observers_see_the_start_and_every_step_with_its_cost(fake, port, master) -> None:
    units = {"a": fake("a", outputs=[port("x")]), "b": fake("b", [port("x")], [port("y")])}
    first, second = _Watch(), _Watch()
    master(units, step_ms=2.0, steps=3).run([first, second])
    assert first.steps == second.steps
    assert [(step.number, step.time_ms, step.size_ms) for step in first.steps[1:]] == [
        (1, 2.0, 2.0),
        (2, 4.0, 2.0),
        (3, 6.0, 2.0),
    ]
    assert first.steps[0].time_ms == 0.0
    for step in first.steps[1:]:
        assert set(step.seconds) >= {"a", "b", "master"}
        assert min(step.seconds.values()) >= 0.0
        assert (step.sweeps.iterations, step.rejected) == (1, 0)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("culprit", ["a", "b", "c"])
def test_a_failing_unit_is_named_with_time_and_reason_after_all_good_steps(
    fake, port, master, scheme: str, culprit: str
) -> None:
    reason = ParticipantError("the fibre tore")
    units = {
        name: fake(name, [port("u")], [port("x_" + name)], *([_fails_at(4, reason)] if name == culprit else []))
        for name in "abc"
    }
    watch = _Watch()
    with pytest.raises(RunError) as caught:
        master(units, scheme=scheme, step_ms=0.5, steps=9).run([watch])
    message = str(caught.value)
    for word in (f"unit '{culprit}'", "from 1.5 to 2 ms", "the fibre tore", "up to 1.5 ms are complete"):
        assert word in message
    assert [step.number for step in watch.steps] == [0, 1, 2, 3]


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_an_output_that_is_no_number_is_named_with_its_unit_and_place(
    fake, port, master, scheme: str, bad: float
) -> None:
    # Three units, so that the one to blame is neither the first nor the last that stepped.
    units = {
        "a": fake("a", outputs=[port("p")]),
        "b": fake("b", [port("p")], [port("field", shape=(3,))], _fails_at(3, bad)),
        "c": fake("c", [port("field", shape=(3,))], [port("q")]),
    }
    watch = _Watch()
    with pytest.raises(RunError) as caught:
        master(units, scheme=scheme, steps=9).run([watch])
    message = str(caught.value)
    for word in ("unit 'b'", "from 2 to 3 ms", "field", "not finite", "[2]", "up to 2 ms are complete"):
        assert word in message
    assert [step.number for step in watch.steps] == [0, 1, 2]
    assert not any(call[1] == "set" and np.isnan(call[3]).any() for call in units["c"].calls)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_an_output_that_nobody_is_connected_to_may_not_be_nan_either(fake, port, master, scheme: str) -> None:
    units = {"a": fake("a", outputs=[port("p")]), "b": fake("b", outputs=[port("q")], law=_fails_at(3, float("nan")))}
    watch = _Watch(read="b.q")
    with pytest.raises(RunError, match=r"unit 'b'.*q.*not finite"):
        master(units, scheme=scheme, steps=9).run([watch])
    assert [step.number for step in watch.steps] == [0, 1, 2]


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_a_unit_that_refuses_its_input_is_blamed_and_no_other(fake, port, master, scheme: str) -> None:
    class Refusing(fake):  # type: ignore[misc, valid-type]
        def set(self, name: str, values: Any) -> None:
            super().set(name, values)
            if float(values) >= 2.0:
                raise ParticipantError(f"{name} is too much for me")

    units = {
        "a": fake("a", outputs=[port("x")], law=_fails_at(99, 0.0)),
        "b": Refusing("b", [port("x")], [port("y")]),
        "c": fake("c", outputs=[port("z")]),
    }
    with pytest.raises(RunError, match=r"unit 'b'.*x is too much for me"):
        master(units, scheme=scheme, steps=9).run([])


def test_an_output_that_cannot_be_fetched_ends_the_run_like_a_failing_step(fake, port, master) -> None:
    class Mute(fake):  # type: ignore[misc, valid-type]
        def get(self, name: str) -> Any:
            if len(self.calls) > 4:
                raise ParticipantError("lost my voice")
            return super().get(name)

    units = {"a": fake("a", outputs=[port("p")]), "b": Mute("b", outputs=[port("q")])}
    with pytest.raises(RunError, match=r"unit 'b'.*lost my voice"):
        master(units, steps=9).run([_Watch(read="b.q")])


@pytest.mark.parametrize("moment", ["begin", "complete"])
def test_a_unit_that_cannot_start_is_named_before_anyone_saw_a_step(
    fake, port, master, moment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(self: Any) -> None:
        raise ParticipantError("there is no state to start from")

    units = {"a": fake("a", outputs=[port("x")]), "b": fake("b", [port("x")])}
    monkeypatch.setattr(units["b"], moment, fail.__get__(units["b"]))
    watch = _Watch()
    with pytest.raises(RunError, match=r"unit 'b' failed during initialisation: there is no state to start from"):
        master(units, steps=9).run([watch])
    assert watch.steps == []


def test_wrong_input_that_only_a_unit_can_see_stays_wrong_input(
    fake, port, master, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse() -> None:
        raise InputError("unit 'a': no base")

    unit = fake("a", outputs=[port("x")])
    monkeypatch.setattr(unit, "complete", refuse)
    with pytest.raises(InputError, match="no base"):
        master({"a": unit}, steps=1).run([])


def test_stopping_by_hand_keeps_what_was_accepted(fake, port, master) -> None:
    def law(given: Any, before: Any, time: float, size: float) -> dict[str, Any]:
        if time > 0.0025:
            raise KeyboardInterrupt
        return before

    watch = _Watch()
    with pytest.raises(KeyboardInterrupt):
        master({"a": fake("a", outputs=[port("x")], law=law)}, steps=9).run([watch])
    assert [step.number for step in watch.steps] == [0, 1, 2, 3]


def test_units_whose_outputs_are_all_fixed_do_not_step(fake, port, master) -> None:
    units = {
        "maker": fake("maker", [], [port("f", fixed=True)]),
        "mover": fake("mover", [], [port("f", fixed=True), port("x")]),
        "listener": fake("listener", [port("x")]),
    }
    assert stepping_order(units, None) == ["mover", "listener"]
    assert stepping_order(units, ["listener", "maker", "mover"]) == ["listener", "mover"]


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (["a", "bb"], ["unknown unit 'bb'", "did you mean 'b'?"]),
        (["a", "b", "a"], ["named twice"]),
        (["a"], ["b is missing", "every unit that steps"]),
        ([], ["a, b is missing"]),
    ],
)
def test_an_order_that_is_none_is_refused(fake, port, order: list[str], words: list[str]) -> None:
    units = {name: fake(name, outputs=[port("x")]) for name in "ab"}
    with pytest.raises(InputError) as caught:
        stepping_order(units, order)
    assert str(caught.value).startswith("coupling.order: ")
    for word in words:
        assert word in str(caught.value)
