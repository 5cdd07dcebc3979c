"""If these fail, a run is about to fail and nobody is told, or a sound one is called unstable."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.connections import End
from cardiac_cosim.orchestrator.coupling.exchange import Inputs
from cardiac_cosim.orchestrator.coupling.growth import Growth
from cardiac_cosim.orchestrator.coupling.master import Accepted, Master
from cardiac_cosim.orchestrator.errors import RunError


@dataclass
class _Watch:
    steps: list[Accepted] = field(default_factory=list)

    def accept(self, step: Accepted, exchange: Any) -> None:
        self.steps.append(step)

    def growth(self, name: str) -> list[float | None]:
        """By step."""
        return [step.growth.get(name) for step in self.steps if step.number]


@pytest.fixture
def ring(fake: Any, port: Any) -> Callable[..., dict[str, Any]]:
    """Units a, b, … in a ring, each with what the one before gives; a's output is `gain` of that, plus 1, at once."""

    def make(gain: float, count: int = 2) -> dict[str, Any]:
        names = "abcde"[:count]
        units = {}
        for name, before in zip(names, names[-1] + names, strict=False):

            def law(given: Any, *_: Any, name: str = name, before: str = before) -> dict[str, Any]:
                return {f"x{name}": gain * given[f"x{before}"] + 1.0 if name == "a" else given[f"x{before}"]}

            units[name] = fake(name, [port(f"x{before}")], [port(f"x{name}")], law=law)
        return units

    return make


def _run(master: Any, units: dict[str, Any], steps: int, **rest: Any) -> tuple[Master, _Watch]:
    coupled, watch = master(units, steps=steps, **rest), _Watch()
    coupled.run([watch])
    return coupled, watch


# --- loops of known gain ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gain", [-0.98, -1.02, -1.5, -3.0])
@pytest.mark.parametrize(("scheme", "count", "waiting"), [("gauss-seidel", 2, 1), ("jacobi", 2, 2), ("jacobi", 3, 3)])
def test_an_explicit_loop_grows_as_theory_says(
    ring: Any, master: Any, gain: float, scheme: str, count: int, waiting: int
) -> None:
    coupled, watch = _run(master, ring(gain, count), 40, scheme=scheme)
    rate = abs(gain) ** (1.0 / waiting)
    last = [value for value in watch.growth("a.xa")[-12:] if value]
    np.testing.assert_allclose(last, rate, rtol=1e-6)
    found = coupled.growth.found["a.xa"]
    assert found.kind == ("growing" if gain < -1.0 else "ringing")
    assert found.rate == pytest.approx(rate, rel=1e-6)
    assert found.period_steps == 2 * waiting
    assert found.to_ms == 40.0
    assert found.share > 0.1


@pytest.mark.parametrize(("scheme", "waiting"), [("gauss-seidel", 1), ("jacobi", 2)])
def test_the_limit_of_stability_is_found_to_one_per_cent(ring: Any, master: Any, scheme: str, waiting: int) -> None:
    for gain, kind in ((-0.99, "ringing"), (-1.01, "growing")):
        coupled, _ = _run(master, ring(gain), 60, scheme=scheme)
        assert {found.kind for found in coupled.growth.found.values()} == {kind}, gain


@pytest.mark.parametrize(("order", "limit"), [(1, 1.0 / 3.0), (2, 1.0 / 7.0)])
def test_extrapolated_inputs_have_lower_limits_which_are_seen_and_named(
    ring: Any, master: Any, order: int, limit: float
) -> None:
    for factor, kind in ((0.98, "ringing"), (1.02, "growing")):
        coupled, _ = _run(master, ring(-factor * limit), 80, inputs=Inputs(order))
        assert coupled.growth.found["a.xa"].kind == kind
        (told,) = coupled.diagnosis.paragraphs(coupled.growth.found)
        (numbers,) = re.findall(r"\|g\| is about (\S+) here.* it is above (\S+),", told)
        gain, above = map(float, numbers)
        assert above == pytest.approx(limit, rel=1e-2)
        # The largest rate is one of the first, which have not settled.
        assert gain == pytest.approx(factor * limit, rel=1.5e-2)
        assert "coupling.extrapolation: 0" in told


@pytest.mark.parametrize(
    ("gain", "scheme"),
    [*((gain, "gauss-seidel") for gain in (-0.5, 0.5, 0.98, 1.02)), *((gain, "jacobi") for gain in (-0.5, 0.5))],
)
def test_loops_that_do_not_alternate_or_settle_are_not_told_of(
    ring: Any, master: Any, gain: float, scheme: str
) -> None:
    coupled, _ = _run(master, ring(gain), 60, scheme=scheme)
    assert {found.kind for found in coupled.growth.found.values()} <= {"decaying"}
    assert coupled.diagnosis.paragraphs(coupled.growth.found) == []


def test_a_loop_that_fades_says_so_and_how_fast(ring: Any, master: Any) -> None:
    coupled, _ = _run(master, ring(-0.5), 60)
    found = coupled.growth.found["b.xb"]
    assert (found.kind, found.period_steps) == ("decaying", 2)
    assert found.rate == pytest.approx(0.5, rel=1e-6)
    # It is followed until a millionth of the motion is left.
    assert 15.0 < found.to_ms < 25.0


def test_values_beyond_all_squares_are_still_measured(ring: Any, master: Any) -> None:
    # 3⁴⁰⁰ is 1e191, whose square is no number any more.
    coupled, watch = _run(master, ring(-3.0), 400)
    assert all(value == pytest.approx(3.0) for value in watch.growth("a.xa")[-50:])
    assert coupled.growth.found["a.xa"].kind == "growing"
    with (
        np.errstate(over="ignore"),
        pytest.raises(RunError, match=r"not finite.* b\.xb alternates .* grows by a factor of 3 at .*holds for a\.xa"),
    ):
        _run(master, ring(-3.0), 700)


def test_a_unit_that_waits_is_measured_by_the_steps_it_takes(ring: Any, master: Any) -> None:
    coupled, watch = _run(master, ring(-1.2), 90, every={"a": 3, "b": 3}, every_ms=90.0)
    rows = watch.growth("a.xa")
    assert [row is None for row in rows[-6:]] == [True, True, False] * 2
    assert rows[-1] == pytest.approx(1.2, rel=1e-6)
    assert coupled.growth.found["a.xa"].rate == pytest.approx(1.2, rel=1e-6)


def test_it_is_told_after_eight_alternations_and_not_before(ring: Any, master: Any) -> None:
    # Three steps are needed to see the first.
    for steps, known in ((9, False), (10, True)):
        coupled, _ = _run(master, ring(-1.5), steps)
        assert ("a.xa" in coupled.growth.found) is known
    coupled, _ = _run(master, ring(-1.5), 5)
    # Had the run failed now, less would be enough.
    assert coupled.growth.suspected["a.xa"].kind == "growing"
    assert coupled.growth.found == {}


def test_a_run_that_never_began_has_nothing_to_tell(ring: Any, master: Any) -> None:
    coupled = master(ring(-1.5))
    assert coupled.growth.suspected == coupled.growth.found == {}


def test_what_is_kept_goes_on_to_the_bit(ring: Any, master: Any) -> None:
    for at in (0, 1, 3, 9, 21):
        whole, watch = _run(master, ring(-1.1), 30)
        begun = master(ring(-1.1), steps=30)
        begun.run([first := _Watch()], _After(at))
        goes_on, rest = master(ring(-1.1), steps=30), _Watch()
        goes_on.resume(begun.memory())
        goes_on.run([rest])
        assert [*first.growth("a.xa"), *rest.growth("a.xa")] == watch.growth("a.xa")
        assert goes_on.growth.found == whole.growth.found


class _After:
    """True from the so-many-th time on that it is asked."""

    def __init__(self, steps: int) -> None:
        self._left = steps

    def __bool__(self) -> bool:
        self._left -= 1
        return self._left < 0


# --- fields that only seem to alternate ---------------------------------------------------------------------------


@dataclass
class _Played:
    """An exchange of one field that is played from a list."""

    end_ms: float = 0.0
    value: Any = None

    def latest(self, end: End) -> Any:
        return self.value

    def stepped(self, end: End) -> bool:
        return True


@pytest.fixture
def play(fake: Any, port: Any) -> Callable[..., Growth]:
    def played(values: Iterable[Any], times: Sequence[float] | None = None) -> Growth:
        from cardiac_cosim.orchestrator.coupling.connections import connect

        fields = [np.asarray(value, float) for value in values]
        units = {"a": fake("a", outputs=[port("x", shape=fields[0].shape)])}
        units["b"] = fake("b", [port("x", shape=fields[0].shape)])
        growth = Growth(units, connect(units, []))
        growth.begin(exchange := _Played(value=fields[0]))  # type: ignore[arg-type]
        for number, value in enumerate(fields[1:], start=1):
            exchange.end_ms, exchange.value = float(number) if times is None else times[number], value
            growth.add(exchange)  # type: ignore[arg-type]
        return growth

    return played


@pytest.mark.parametrize("width", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("spread", [0.0, 0.5, 0.9])
def test_a_front_that_passes_in_steps_longer_than_itself_is_no_alternation(
    play: Any, width: float, spread: float
) -> None:
    random = np.random.default_rng(3)
    place = np.linspace(0.0, 60.0, 600)
    position = np.cumsum(1.0 + spread * random.uniform(-1.0, 1.0, 50))
    growth = play(np.tanh((at - place) / width) for at in position)
    assert growth.suspected == {}


@pytest.mark.parametrize("size", [1, 3, 10, 1000])
def test_noise_is_no_alternation(play: Any, size: int) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        growth = play(random.standard_normal((300, size)))
        assert not {found.kind for found in growth.found.values()} & {"growing", "ringing"}, seed


def test_upstrokes_waves_and_fields_at_rest_are_no_alternation(play: Any) -> None:
    steps = np.arange(80.0)
    for values in (
        np.exp(0.3 * steps),
        1.0 / (1.0 + np.exp(20.0 - steps)),
        np.sin(0.8 * steps),
        np.full(80, 0.1),
        np.zeros(80),
        # A jump, and rounding about a constant.
        np.where(steps < 20.0, 0.0, 1.0),
        0.1 + 1e-17 * (-1.0) ** steps,
        # What alternates by less than a millionth of its motion, as an inner tolerance may.
        steps + 1e-6 * (-1.0) ** steps,
    ):
        assert play(values).suspected == {}


def test_an_alternation_is_told_from_the_motion_beneath_it(play: Any) -> None:
    steps = np.arange(80.0)
    found = play(10.0 * np.sin(0.05 * steps) + 1e-3 * (-1.1) ** steps).found["a.x"]
    assert (found.kind, found.period_steps) == ("growing", 2)
    assert found.rate == pytest.approx(1.1, rel=3e-2)


def test_steps_of_changing_length_do_not_change_what_is_measured(play: Any) -> None:
    random = np.random.default_rng(8)
    times = np.cumsum(np.concatenate([[0.0], random.uniform(0.5, 1.5, 60)])).tolist()
    growth = play([5.0 * time + (-1.0) ** number for number, time in enumerate(times)], times)
    found = growth.found["a.x"]
    assert found.rate == pytest.approx(1.0, rel=1e-9)
    assert found.period_steps == 2
    # ±1 about a line that the field has moved along.
    assert found.share == pytest.approx(1.0 / (5.0 * times[-1]), rel=0.05)
    smooth = play([np.sin(0.2 * time) for time in times], times)
    assert smooth.suspected == {}


def test_the_worst_stretch_is_told_and_not_the_last(play: Any) -> None:
    signs = (-1.0) ** np.arange(40)
    amplitude = np.concatenate([1.3 ** np.arange(15), 1.3**14 * 0.95 ** np.arange(1, 26)])
    found = play(signs * amplitude).found["a.x"]
    assert found.kind == "growing"
    assert found.rate == pytest.approx(1.3, rel=1e-6)
    assert found.from_ms < 5.0
    assert 14.0 <= found.to_ms <= 22.0


def test_only_what_moves_continuously_in_every_step_is_followed(fake: Any, port: Any, master: Any) -> None:
    names = ("moves", "once", "event")
    given = [port("moves"), port("once", fixed=True), port("event", type="Boolean", discrete=True)]
    coupled = master({"a": fake("a", outputs=given), "b": fake("b", given)})
    assert {str(link.source) for link in coupled.connections} == {f"a.{name}" for name in names}
    assert coupled.growth.names == ["a.moves"]


def test_times_of_a_stretch_are_those_of_the_run(ring: Any, master: Any) -> None:
    coupled, watch = _run(master, ring(-1.5), 20, step_ms=2.5)
    found = coupled.growth.found["a.xa"]
    seen = [step.time_ms for step in watch.steps if step.growth.get("a.xa")]
    assert found.to_ms == seen[-1] == 50.0
    # The stretch begins where its first alternating step does.
    assert found.from_ms == pytest.approx(seen[0] - 2.5)
    assert all(late > early for early, late in pairwise(seen))
