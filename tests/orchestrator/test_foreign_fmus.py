"""If these fail, the master couples hearts only: FMUs from elsewhere are driven otherwise than FMI 2.0 says."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import build_body
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError, ParticipantLost, ParticipantTerminated
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.run import run_scenario, show_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from oscillator import Oscillator

pytestmark = pytest.mark.skipif(build_body.compiler() is None, reason="no C compiler to build foreign FMUs with")

# Force–displacement coupling: the second mass holds the spring between them and gives its force.
_SCENARIO = """\
name: oscillator
units:
  first: {fmu: FIRST, parameters: {k: 10, c: 0.2}, start: {x: 1}}
  second: {fmu: SECOND, parameters: {k: 20, c: 0.3, k_c: 10, c_c: 0.5}, start: {x: 0.5}}
connections:
  - first.x -> second.x_in
  - first.v -> second.v_in
  - second.F -> first.F_in
coupling: {scheme: jacobi, step_ms: 10}
run: {stop_ms: 2000}
output: {every_ms: 2000}
"""
#: The same two masses as in the theory; at the start F is that of the start values.
_MASSES = Oscillator()


@pytest.fixture
def simulate(tmp_path: Path, bodies: dict[str, Path]) -> Callable[..., tuple[np.ndarray, Path]]:
    """Run the oscillator out of two FMUs; the time series and the folder."""

    def run(*sets: str, kinds: tuple[str, str] = ("whole", "whole")) -> tuple[np.ndarray, Path]:
        text = _SCENARIO.replace("FIRST", str(bodies[kinds[0]])).replace("SECOND", str(bodies[kinds[1]]))
        (tmp_path / "oscillator.yaml").write_text(text)
        out = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        run_scenario(load_scenario(tmp_path / "oscillator.yaml", sets), tmp_path, out)
        return np.genfromtxt(out / "timeseries.csv", delimiter=",", names=True), out

    return run


def _states(series: np.ndarray) -> np.ndarray:
    return np.array([series[name][-1] for name in ("firstx", "firstv", "secondx", "secondv")])


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_input_derivatives_give_the_order_of_the_extrapolation(simulate: Any, scheme: str, order: int) -> None:
    # There are no past values to extrapolate the first step with. That costs an order unless nothing moves at first,
    # as without a damper between the masses.
    damper = 0.5 if order < 2 else 0.0
    masses = Oscillator(damping=(0.2, 0.3, damper))
    errors = []
    for step in (10.0, 5.0, 2.5):
        kind = "linear" if order else "hold"
        series, _ = simulate(
            f"coupling.scheme={scheme}",
            f"coupling.step_ms={step}",
            f"coupling.extrapolation={order}",
            f"coupling.interpolation={kind}",
            f"units.second.parameters.c_c={damper}",
        )
        errors.append(np.abs(_states(series) - masses.exact(2.0)).max())
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    # Under Gauss–Seidel what is known is interpolated by a line: that bounds the order.
    expected = min(order + 1, 2) if scheme == "gauss-seidel" else order + 1
    np.testing.assert_allclose(orders, expected, atol=0.2)


def test_a_run_without_a_heart_leaves_series_and_log_and_no_fields(simulate: Any) -> None:
    series, out = simulate()
    assert series.dtype.names is not None
    assert len(series) == 201
    assert {path.name for path in out.iterdir()} == {"timeseries.csv", "coupling.csv", "summary.json", "profile.json"}
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["status"], summary["activation_time_ms"]) == ("done", {})
    assert "scene" not in summary["scenario"]
    assert series["firstx"][0] == 1.0
    assert series["secondx"][0] == 0.5


def test_iterated_schemes_go_back_through_the_states_of_foreign_fmus(simulate: Any) -> None:
    iterate = "coupling.iterate={acceleration: anderson, converge: {second.F: {absolute: 1e-12}}}"
    linear = "coupling.interpolation=linear"
    found = [
        _states(simulate(iterate, linear, f"coupling.scheme={scheme}")[0]) for scheme in ("jacobi", "gauss-seidel")
    ]
    np.testing.assert_allclose(found[0], found[1], atol=1e-10)
    assert np.abs(found[0] - _MASSES.exact(2.0)).max() < 2e-3


def test_fmus_without_states_run_explicitly_and_are_named_where_a_scheme_needs_more(simulate: Any) -> None:
    explicit, _ = simulate(kinds=("whole", "whole"))
    stateless, out = simulate(kinds=("stateless", "whole"))
    assert np.array_equal(_states(explicit), _states(stateless))
    assert json.loads((out / "summary.json").read_text())["resumable"] is False
    for setting in ("coupling.iterate={converge: {second.F: {absolute: 1e-9}}}", "coupling.adaptive={}"):
        with pytest.raises(InputError, match=r"'first' cannot roll back \(canGetAndSetFMUstate is false\)"):
            simulate(setting, kinds=("stateless", "whole"))
    with pytest.raises(InputError, match=r"'second' takes equal steps only"):
        simulate("coupling.adaptive={}", kinds=("whole", "equal"))


def test_an_fmu_that_cannot_ramp_holds_the_value_at_the_end_of_the_step(simulate: Any) -> None:
    linear = ("coupling.interpolation=linear", "coupling.extrapolation=1")
    both, _ = simulate(*linear)
    one, _ = simulate(*linear, kinds=("whole", "holding"))
    error = [np.abs(_states(series) - _MASSES.exact(2.0)).max() for series in (both, one)]
    assert error[0] < 0.2 * error[1]
    assert error[1] < 0.1


def test_inputs_that_are_held_although_linear_ones_are_asked_for_are_shown(
    bodies: dict[str, Path], tmp_path: Path
) -> None:
    text = _SCENARIO.replace("FIRST", str(bodies["whole"])).replace("SECOND", str(bodies["holding"]))
    (tmp_path / "oscillator.yaml").write_text(text)

    def held(*sets: str) -> list[str]:
        lines = show_scenario(load_scenario(tmp_path / "oscillator.yaml", sets), tmp_path).splitlines()
        return [line.split(":")[0].strip() for line in lines if "held over every step" in line]

    assert held("coupling.interpolation=linear") == ["second.x_in", "second.v_in"]
    assert held() == []


def test_adaptive_steps_of_foreign_fmus_meet_a_smaller_tolerance_with_a_smaller_error(simulate: Any) -> None:
    errors, steps = [], []
    for tolerance in (1e-2, 1e-3, 1e-4):
        series, _ = simulate(f"coupling.adaptive={{tolerance: {tolerance}, min_ms: 0.05, max_ms: 500}}")
        errors.append(np.abs(_states(series) - _MASSES.exact(2.0)).max())
        steps.append(len(series) - 1)
        assert series["time_ms"][-1] == 2000.0
    # The error of a step of second order goes with the square of its length.
    assert np.all(np.diff(np.log(errors)) < -1.0)
    np.testing.assert_allclose(np.diff(np.log(steps)), 0.5 * np.log(10.0), atol=0.5)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("units.first.parameters.mass=1", "no parameter 'mass'"),
        ("units.first.start.y=1", "no variable 'y' that takes a start value"),
        ("units.first.start.F=1", "no variable 'F' that takes a start value"),
        ("units.first.start.x=text", "start value of 'x' of type Real cannot be 'text'"),
        ("units.first.parameters.m=0", "the mass has to be above zero, 100 % of it"),
        ("output.probes_mm={a: [0, 0, 0]}", "`output.probes_mm` needs a `scene`"),
    ],
)
def test_what_an_fmu_does_not_have_is_explained(simulate: Any, setting: str, words: str) -> None:
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        simulate(setting)


def test_a_step_that_an_fmu_refuses_is_told_in_its_words(simulate: Any) -> None:
    from cardiac_cosim.orchestrator.errors import RunError

    with pytest.raises(RunError, match="unit 'first' failed in the step from 0 to 10 ms: the spring broke"):
        simulate("units.first.start.x=1e7")


@pytest.mark.parametrize(
    "settings",
    [
        (),
        ("units.first.every=4", "output.every_ms=80"),
        ("coupling.iterate={converge: {second.F: {absolute: 1e-9}}}",),
        ("coupling.adaptive={tolerance: 0.02, min_ms: 1, max_ms: 100}",),
    ],
    ids=["explicit", "every", "iterated", "adaptive"],
)
def test_an_fmu_that_commits_a_step_only_when_nobody_goes_back_before_it_moves(simulate: Any, settings: Any) -> None:
    plain, _ = simulate(*settings)
    commits, _ = simulate(*settings, kinds=("commits", "commits"))
    assert plain["firstx"][-1] != 1.0
    assert np.array_equal(_states(plain), _states(commits))


def test_parameters_survive_an_fmu_that_resets_them_when_the_experiment_is_set_up(simulate: Any) -> None:
    plain, _ = simulate()
    resets, _ = simulate(kinds=("resets", "resets"))
    assert np.array_equal(_states(plain), _states(resets))


@pytest.fixture
def first(bodies: dict[str, Path]) -> Any:
    """A body of some kind, about to step from 50 ms on."""
    made = []

    def make(kind: str) -> Any:
        made.append(FmuParticipant("first", bodies[kind], {}, {"x": 1.0}))
        made[-1].begin()
        made[-1].complete()
        return made[-1]

    yield make
    for participant in made:
        participant.close()


def test_an_fmu_that_asks_for_the_end_is_told_from_one_that_fails(first: Any) -> None:
    with pytest.raises(ParticipantTerminated, match="requested the end of the simulation") as end:
        first("ends").start(0.05, 0.01)
    assert end.value.time_s == 0.05
    with pytest.raises(ParticipantError, match=r"^40 % too long$") as failure:
        first("reasons").start(0.05, 0.01)
    assert not isinstance(failure.value, ParticipantTerminated | ParticipantLost)


def test_an_fmu_that_is_beyond_repair_is_lost(first: Any) -> None:
    body = first("dies")
    with pytest.raises(ParticipantLost, match="beyond repair"):
        body.start(0.05, 0.01)


def test_an_fmu_that_takes_no_second_derivatives_gets_the_first_and_says_so_once(
    simulate: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    settings = ("coupling.interpolation=linear", "coupling.extrapolation=2")
    capfd.readouterr()
    lines, _ = simulate(*settings, kinds=("lines", "lines"))
    notes = [line for line in capfd.readouterr().err.splitlines() if line.startswith("note: ")]
    assert [note.partition(";")[0] for note in notes] == [
        f"note: unit '{unit}' accepts derivatives of its inputs up to order 1" for unit in ("first", "second")
    ]
    # Straight lines, to ends that are known to second order.
    assert np.abs(_states(lines) - _MASSES.exact(2.0)).max() < 5e-3


# --- FMUs that end the process ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("quirk", "code", "how"), [("leaves", 3, "exit(0)"), ("breaks", 139, "SIGSEGV")])
def test_a_run_that_an_fmu_ends_does_not_pass_for_done(
    quirk: str, code: int, how: str, bodies: dict[str, Path], tmp_path: Path
) -> None:
    text = _SCENARIO.replace("FIRST", str(bodies[quirk])).replace("SECOND", str(bodies["whole"]))
    (tmp_path / "oscillator.yaml").write_text(text)
    command = [sys.executable, "-m", "cardiac_cosim.cli", "run", str(tmp_path / "oscillator.yaml")]
    ended = subprocess.run(
        [*command, "--output", str(tmp_path / "out"), "--no-figures", "--no-report"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ended.returncode == code
    assert ended.stderr.count("\n") == 1
    assert f"{how} in unit 'first' at 50 ms" in ended.stderr.replace("call of ", "")
    # What was done until then is there, and does not say that it is all.
    series = np.genfromtxt(tmp_path / "out" / "timeseries.csv", delimiter=",", names=True)
    assert series["time_ms"][-1] == 50.0
    assert not (tmp_path / "out" / "summary.json").exists()


@pytest.mark.parametrize("every", [3, 7])
def test_a_unit_of_equal_steps_is_not_stepped_less_often_where_that_does_not_divide(every: int, simulate: Any) -> None:
    with pytest.raises(InputError, match=r"units\.second\.every: it takes equal steps only"):
        simulate(f"units.second.every={every}", kinds=("whole", "equal"))
    simulate("units.second.every=4", "run.stop_ms=80", "output.every_ms=40", kinds=("whole", "equal"))
