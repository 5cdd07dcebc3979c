"""If these fail, a person whose run fails is not told that it is the coupling, which loop it is, or what helps."""

import json
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.alternation import Alternation
from cardiac_cosim.orchestrator.coupling.master import Master
from cardiac_cosim.orchestrator.errors import ParticipantError, ParticipantTerminated, RunError
from cardiac_cosim.orchestrator.run import Outcome, run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from rich.console import Console

#: A contracting cell whose active stress follows its stretch at once: an algebraic loop, written without anything that
#: would stabilise it.
_CELL = """\
name: cell
scene: {geometry: cell}
units:
  fibers: {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology, parameters: {time_scale_reduction: 0}}
  active_stress: {unit: active_stress, parameters: {length_dependence: 4}}
  mechanics: {unit: local_mechanics}
connect_by_name: false
connections:
  - fibers.fiber -> electrophysiology.fiber
  - fibers.fiber -> mechanics.fiber
  - fibers.sheet -> mechanics.sheet
  - electrophysiology.potential -> active_stress.potential
  - active_stress.active_stress -> mechanics.active_stress
  - mechanics.stretch -> active_stress.stretch
coupling: {step_ms: 1}
run: {stop_ms: 60, participants: native, checkpoint_every: 10}
output: {every_ms: 10, probes_mm: {cell: [10, 0, 0]}}
"""


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., Outcome]:
    (tmp_path / "cell.yaml").write_text(_CELL)

    def started(*sets: str, out: str = "out", console: Console | None = None, resume: bool = False) -> Outcome:
        scenario = load_scenario(tmp_path / "cell.yaml", sets)
        return run_scenario(scenario, tmp_path, tmp_path / out, console, resume=resume)

    return started


def _summary(tmp_path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((tmp_path / "out" / "summary.json").read_text())
    return content


def test_a_run_that_fails_by_its_coupling_says_so_before_and_after(run: Any, tmp_path: Path) -> None:
    console = Console(file=StringIO(), width=80)
    with pytest.raises(RunError) as failure:
        run(console=console)
    message = str(failure.value)
    for words in (
        "unit 'active_stress' failed in the step from 32 to 33 ms",
        "mechanics.stretch alternates from exchange to exchange with a period of 2, and grows by a factor of 1.0",
        "the same holds for active_stress.active_stress",
        "in the loop mechanics -> active_stress -> mechanics, which is coupled explicitly",
        "no step is short enough",
        "coupling.iterate with `acceleration: anderson` and `converge: {mechanics.stretch: {relative: 1e-4}}`",
    ):
        assert words in message, words
    # Each field was announced once, well before the failure.
    live = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert sorted(line.split(": ")[2].split()[0] for line in live) == [
        "active_stress.active_stress",
        "mechanics.stretch",
    ]
    assert all(float(line.split(": ")[1].removesuffix(" ms")) < 20.0 for line in live)
    summary = _summary(tmp_path)
    assert summary["failure"] == {"kind": "unit", "unit": "active_stress", "time_ms": 33.0}
    assert summary["warnings"] == [message.split(" are complete. ")[1]]
    found = summary["growth"]["mechanics.stretch"]
    assert found.keys() == {"kind", "rate", "period_steps", "from_ms", "to_ms", "share"}
    assert (found["kind"], found["period_steps"], found["to_ms"]) == ("growing", 2, 32.0)
    assert 1.05 < found["rate"] < 1.1
    rows = np.genfromtxt(tmp_path / "out" / "coupling.csv", delimiter=",", names=True)["growth_mechanicsstretch"]
    np.testing.assert_allclose(rows[-8:], found["rate"], rtol=0.05)


def test_just_inside_the_limit_it_fades_and_nobody_is_alarmed(run: Any, tmp_path: Path) -> None:
    console = Console(file=StringIO())
    outcome = run("units.active_stress.parameters.length_dependence=3.5", console=console)
    assert console.file.getvalue() == ""  # type: ignore[attr-defined]
    assert outcome.warnings == ()
    assert "failure" not in outcome.summary
    assert {found["kind"] for found in outcome.summary["growth"].values()} == {"decaying"}


def test_the_remedy_that_is_named_helps(run: Any) -> None:
    iterate = "coupling.iterate={acceleration: anderson, converge: {mechanics.stretch: {relative: 1e-4}}}"
    outcome = run(iterate)
    assert outcome.summary["status"] == "done"
    # What the criterion lets pass in one sweep alternates, and grows up to the criterion: no reason for an alarm.
    assert outcome.warnings == ()
    assert outcome.summary["growth"] == {}


def test_a_finished_run_that_rings_has_a_milder_note(run: Any) -> None:
    outcome = run("units.active_stress.parameters.length_dependence=3.8")
    (note,) = outcome.warnings
    assert outcome.summary["warnings"] == [note]
    assert outcome.summary["growth"]["mechanics.stretch"]["kind"] == "ringing"
    assert "of its amplitude at each" in note
    assert "grows" not in note


def test_resumed_it_measures_the_same_to_the_bit(run: Any, tmp_path: Path, stopped: Any) -> None:
    sets = ("units.active_stress.parameters.length_dependence=3.8",)
    whole = run(*sets)
    (tmp_path / "again").mkdir()
    for steps in (11, 21):
        scenario = load_scenario(tmp_path / "cell.yaml", sets)
        with pytest.MonkeyPatch.context() as patch:
            _stop(patch, steps)
            with pytest.raises(RunError, match="stopped"):
                run_scenario(scenario, tmp_path, tmp_path / "again", resume=True)
    resumed = run(*sets, out="again", resume=True)
    assert resumed.summary["growth"] == whole.summary["growth"]
    assert resumed.warnings == whole.warnings

    def columns(out: str) -> list[list[str]]:
        rows = [line.split(",") for line in (tmp_path / out / "coupling.csv").read_text().splitlines()]
        kept = [place for place, name in enumerate(rows[0]) if name.startswith(("time_ms", "growth_"))]
        return [[row[place] for place in kept] for row in rows]

    assert columns("again") == columns("out")
    assert len(columns("out")) == 61


def _stop(patch: pytest.MonkeyPatch, steps: int) -> None:
    step, taken = Master._take_step, []

    def fails(master: Master) -> Any:
        if len(taken) == steps:
            raise RunError("stopped")
        taken.append(1)
        return step(master)

    patch.setattr(Master, "_take_step", fails)


_SCENARIOS = Path(__file__).parents[2] / "scenarios"
_LONG = ("baseline", "arrival_times", "return_to_rest", "without_feedback", "left_ventricle", "inflation")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=[pytest.mark.long] if path.stem in _LONG else [])
        for path in sorted(_SCENARIOS.glob("*.yaml"))
    ],
)
def test_no_shipped_scenario_is_called_unstable(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(_SCENARIOS / f"{name}.yaml", ["run.participants=native", "run.checkpoint_every=0"])
    outcome = run_scenario(scenario, _SCENARIOS, tmp_path / "out")
    assert "growing" not in {found["kind"] for found in outcome.summary["growth"].values()}
    assert outcome.warnings == ()


@pytest.mark.parametrize(
    "coupling",
    [
        "{adaptive: {}}",
        "{scheme: jacobi, step_ms: 5}",
        "{step_ms: 5, interpolation: linear, extrapolation: 2}",
        "{step_ms: 5, iterate: {converge: {stretch: {relative: 1e-2}}}}",
    ],
)
def test_no_sound_heart_is_called_unstable(coupling: str, small_scenario: Path, tmp_path: Path) -> None:
    scenario = load_scenario(small_scenario, [f"coupling={coupling}", "run.stop_ms=100"])
    outcome = run_scenario(scenario, tmp_path, tmp_path / "out")
    assert not {found["kind"] for found in outcome.summary["growth"].values()} & {"growing", "ringing"}


def test_the_command_tells_of_it(run: Any, cosim: Any, tmp_path: Path) -> None:
    ended = cosim("run", tmp_path / "cell.yaml", "--output", tmp_path / "out")
    assert ended.code == 3
    assert "warning: 12 ms: mechanics.stretch alternates with a period of 2 steps" in ended.err
    rings = cosim(
        *("run", tmp_path / "cell.yaml", "--output", tmp_path / "out"),
        *("--set", "units.active_stress.parameters.length_dependence=3.8"),
    )
    assert rings.code == 0
    assert "alternates from exchange to exchange with a period of 2, and keeps 9" in rings.err


# --- what failed --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "kind", "status"),
    [(ParticipantError("torn"), "unit", "failed"), (ParticipantTerminated("done"), "terminated", "terminated")],
)
def test_a_summary_says_which_unit_failed_and_when(
    error: Exception, kind: str, status: str, run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cardiac_cosim.orchestrator.participants.native import NativeParticipant

    start = NativeParticipant.start

    def fails(participant: Any, time: float, size: float) -> Any:
        if participant.name == "mechanics" and time > 4.5e-3:
            raise error
        return start(participant, time, size)

    monkeypatch.setattr(NativeParticipant, "start", fails)
    with pytest.raises(RunError) as failure:
        run()
    assert (failure.value.kind, failure.value.unit, failure.value.time_ms) == (kind, "mechanics", 6.0)
    summary = _summary(tmp_path)
    assert summary["status"] == status
    assert summary["failure"] == {"kind": kind, "unit": "mechanics", "time_ms": 6.0}


def test_a_summary_says_that_the_coupling_failed(run: Any, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no convergence in 2 sweeps"):
        run("coupling.iterate={max_iterations: 2, converge: {mechanics.stretch: {relative: 1e-9}}}")
    failure = _summary(tmp_path)["failure"]
    assert (failure["kind"], failure["unit"]) == ("coupling", None)
    assert failure["time_ms"] > 0.0


def test_a_summary_says_that_the_results_could_not_be_written(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cardiac_cosim.orchestrator.results.time_series import TimeSeries

    accept = TimeSeries.accept

    def full(series: Any, step: Any, exchange: Any) -> None:
        if step.number == 4:
            raise OSError(28, "No space left on device")
        accept(series, step, exchange)

    monkeypatch.setattr(TimeSeries, "accept", full)
    with pytest.raises(RunError, match="cannot be written"):
        run()
    assert _summary(tmp_path)["failure"] == {"kind": "results", "unit": None, "time_ms": 3.0}


# --- loops --------------------------------------------------------------------------------------------------------


def _units(fake: Any, port: Any) -> dict[str, Any]:
    """a and b feed each other, b and c too, and d follows c."""
    return {
        "a": fake("a", [port("q")], [port("p")]),
        "b": fake("b", [port("p"), port("s")], [port("q"), port("r")]),
        "c": fake("c", [port("r")], [port("s"), port("active_stiffness")]),
        "d": fake("d", [port("s")], [port("t")]),
        "e": fake("e", [port("t")]),
    }


_GROWS = Alternation("growing", 1.5, 2, 3.0, 20.0, 0.25)


def test_the_shortest_way_round_is_named_and_followers_are_left_out(fake: Any, port: Any, master: Any) -> None:
    diagnosis = master(_units(fake, port)).diagnosis
    assert diagnosis.announced("b.q", _GROWS).endswith("in the loop b -> a -> b")
    assert diagnosis.announced("b.r", _GROWS).endswith("in the loop b -> c -> b")
    assert diagnosis.announced("d.t", _GROWS).endswith("in no loop")
    (told,) = diagnosis.paragraphs({"b.q": _GROWS, "c.s": _GROWS, "d.t": _GROWS})
    assert told.startswith("b.q alternates")
    assert "the same holds for c.s" in told
    assert "d.t" not in told
    (alone,) = diagnosis.paragraphs({"d.t": _GROWS})
    assert "It is exchanged in no loop, so unit 'd' alternates by itself" in alone


def test_the_gain_follows_from_rate_period_and_scheme(fake: Any, port: Any, master: Any) -> None:
    found = Alternation("growing", 1.1, 4, 3.0, 20.0, 0.25)
    (told,) = master(_units(fake, port), scheme="jacobi").diagnosis.paragraphs({"a.p": found})
    assert (
        "|g| is that factor to the power of 2. If all its units respond without delay, |g| is about 1.21 here" in told
    )
    (told,) = master(_units(fake, port)).diagnosis.paragraphs({"a.p": _GROWS})
    assert "|g| is that factor. If all its units respond without delay, |g| is about 1.5 here" in told


def test_a_stabilising_output_that_nothing_takes_is_a_remedy(fake: Any, port: Any, master: Any) -> None:
    units = _units(fake, port)
    taken = port("active_stiffness")
    units["b"].inputs["active_stiffness"] = taken
    # Fed by name, it is at work already.
    (told,) = master(units).diagnosis.paragraphs({"c.s": _GROWS})
    assert "active_stiffness" not in told
    units["b"].inputs["active_stiffness"] = port("active_stiffness", live=False, needs="stabilization")
    (told,) = master(units).diagnosis.paragraphs({"c.s": _GROWS})
    assert "c.active_stiffness -> b.active_stiffness and the parameter stabilization of unit 'b'" in told


def test_a_loop_that_cannot_be_iterated_is_not_told_to_be(fake: Any, port: Any, master: Any) -> None:
    units = _units(fake, port)

    class Rigid(fake):  # type: ignore[misc]
        @property
        def abilities(self) -> Any:
            from cardiac_cosim.orchestrator.participants.participant import Abilities

            return Abilities(rolls_back=False)

    units["a"] = Rigid("a", [port("q")], [port("p")])
    (told,) = master(units).diagnosis.paragraphs({"a.p": _GROWS})
    assert "coupling.iterate" not in told
    assert "one of them cannot roll back" in told
