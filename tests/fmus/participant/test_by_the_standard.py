"""If these fail, our master calls somebody else's FMU when or how the standard does not allow it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import build_body
import build_box
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import ParticipantError, RunError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.participant import Ramp
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

Join = Callable[..., FmuParticipant]

pytestmark = pytest.mark.skipif(build_body.compiler() is None, reason="no C compiler to build foreign FMUs with")

#: Value references of the inputs and of the state x in body.c.
_INPUTS, _X = {"5", "6", "7"}, "8"

_OSCILLATOR = """\
name: oscillator
units:
  first: {fmu: BODY, parameters: {k: 10, c: 0.2}, start: {x: 1, F_in: 0.25}}
  second: {fmu: BODY, parameters: {k: 20, c: 0.3, k_c: 10, c_c: 0.5}, start: {x: 0.5}}
connections:
  - first.x -> second.x_in
  - first.v -> second.v_in
  - second.F -> first.F_in
coupling: {scheme: gauss-seidel, step_ms: 10}
run: {stop_ms: 100}
output: {every_ms: 20}
"""

_SCHEMES = {
    "explicit": (),
    "ramped": ("coupling.interpolation=linear", "coupling.extrapolation=1"),
    "parallel": ("coupling.scheme=jacobi", "coupling.interpolation=linear", "coupling.extrapolation=2"),
    "iterated": ("coupling.iterate={converge: {second.F: {absolute: 1e-9}}}", "coupling.interpolation=linear"),
    "adaptive": ("coupling.adaptive={tolerance: 1e-3}",),
}


@pytest.fixture
def journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], dict[str, list[list[str]]]]:
    """What calls the FMUs that tell have had so far, by the instance's name, each as words."""
    path = tmp_path / "journal"
    monkeypatch.setenv("JOURNAL", str(path))

    def read() -> dict[str, list[list[str]]]:
        calls: dict[str, list[list[str]]] = {}
        for name, *words in map(str.split, path.read_text().splitlines()):
            calls.setdefault(name, []).append(words)
        return calls

    return read


def _place(calls: list[list[str]], name: str) -> int:
    """Where the one call of that name stands."""
    (place,) = [number for number, words in enumerate(calls) if words[0] == name]
    return place


@pytest.mark.parametrize("scheme", _SCHEMES)
def test_the_calls_of_a_run(scheme: str, bodies: dict, journal: Any, tmp_path: Path) -> None:
    (tmp_path / "oscillator.yaml").write_text(_OSCILLATOR.replace("BODY", str(bodies["tells"])))
    run_scenario(load_scenario(tmp_path / "oscillator.yaml", _SCHEMES[scheme]), tmp_path, tmp_path / "out")
    told = journal()
    assert set(told) == {"first", "second"}
    for calls in told.values():
        order = ["SetupExperiment", "EnterInitializationMode", "ExitInitializationMode", "Terminate", "FreeInstance"]
        places = [_place(calls, name) for name in order]
        assert places == sorted(places)
        setup, enter, leave, terminate, _ = places
        # Parameters and the state's start after the set-up, as some FMUs forget them there; inputs not before the
        # initialization mode.
        before = [words[1] for words in calls[:enter] if words[0] == "SetReal"]
        assert before
        assert not _INPUTS & set(before)
        assert _X in before
        assert not [words for words in calls[:setup] if words[0] == "SetReal"]
        if calls is told["first"]:
            # Its start value of an input.
            assert ["SetReal", "5"] in calls[enter:leave]
        # Steps have a length, and none is outside of the run.
        steps = [(number, *map(float, words[1:])) for number, words in enumerate(calls) if words[0] == "DoStep"]
        assert steps
        assert min(size for _, _, size in steps) > 0.0
        assert leave < steps[0][0] <= steps[-1][0] < terminate
        assert max(time + size for _, time, size in steps) == pytest.approx(0.1)


def test_nothing_but_freeing_after_an_error(bodies: dict, journal: Any, join: Join) -> None:
    participant = join(bodies["tells"], "broken", k=1.0)
    participant.begin()
    participant.complete()
    participant.set("F_in", np.array(1e9))
    with pytest.raises(ParticipantError, match="the spring broke"):
        participant.start(0.0, 10.0)
    participant.close()
    calls = journal()["broken"]
    assert [words[0] for words in calls[-2:]] == ["fails", "FreeInstance"]
    assert ["Terminate"] not in calls


def test_a_run_that_fails_terminates_those_that_did_not(bodies: dict, journal: Any, tmp_path: Path) -> None:
    text = _OSCILLATOR.replace("BODY", str(bodies["tells"])).replace("step_ms: 10", "step_ms: 1000")
    text = text.replace("stop_ms: 100", "stop_ms: 200000").replace("every_ms: 20", "every_ms: 1000")
    # Springs that push where they should pull.
    (tmp_path / "oscillator.yaml").write_text(text.replace("k: 20", "k: -80"))
    with pytest.raises(RunError, match="the spring broke"):
        run_scenario(load_scenario(tmp_path / "oscillator.yaml"), tmp_path, tmp_path / "out")
    told = journal()
    failed = [name for name, calls in told.items() if ["fails"] in calls]
    assert len(failed) == 1
    for name, calls in told.items():
        assert (["Terminate"] in calls) == (name not in failed)
        assert calls[-1] == ["FreeInstance"]


# --- intermediate updates --------------------------------------------------------------------------------------------

_BOX = """
<Float64 name="time" valueReference="1000" causality="independent" variability="continuous"/>
<Float64 name="u" valueReference="0" causality="input" variability="continuous" start="0" intermediateUpdate="true"/>
<Float64 name="held" valueReference="2" causality="input" variability="continuous" start="0"/>
""" + "".join(
    f'<Float64 name="{name}{k + 1}" valueReference="{first + 2 * k}" causality="output" variability="continuous"/>'
    for name, first in (("u_at_", 17), ("held_at_", 25))
    for k in range(4)
)


@pytest.fixture(scope="module")
def asking(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU that asks for its input four times in a step, and tells what it has been given."""
    return build_box.build_box3(tmp_path_factory.mktemp("asking") / "box.fmu", _BOX, updates=True)


@pytest.fixture
def box(asking: Path, ready: Join) -> FmuParticipant:
    return ready(asking)


def _seen(box: FmuParticipant, name: str = "u") -> list[float]:
    return [float(box.get(f"{name}_at_{k}")) for k in range(1, 5)]


def test_inside_of_a_step_inputs_are_on_the_line(box: FmuParticipant) -> None:
    assert box.abilities.ramps
    box.ramp("u", Ramp(np.array(1.0), np.array(3.0)))
    # What may not be set inside of a step is what the line ends with.
    box.ramp("held", Ramp(np.array(1.0), np.array(3.0)))
    box.start(0.0, 0.5)
    assert _seen(box) == [1.5, 2.0, 2.5, 3.0]
    assert _seen(box, "held") == [3.0] * 4
    # The next one is held at what is set; nothing of the line is left.
    box.set("u", np.array(7.0))
    box.start(0.5, 0.5)
    assert _seen(box) == [7.0] * 4


def test_inside_of_a_step_inputs_are_on_the_parabola(box: FmuParticipant) -> None:
    # u(t) = 1 + 2 t + t², by its values at 0 and 1 and its second derivative.
    box.ramp("u", Ramp(np.array(1.0), np.array(4.0), np.array(2.0)))
    box.start(0.0, 1.0)
    assert _seen(box) == [1.5625, 2.25, 3.0625, 4.0]


def test_a_run_gives_a_foreign_fmu_the_line_between_exchanges(tmp_path: Path, asking: Path, bodies: dict) -> None:
    """The mass's displacement on its line from one exchange to the next, at the quarters of each step."""
    (tmp_path / "line.yaml").write_text(f"""\
name: line
units:
  mass: {{fmu: {bodies["whole"]}, parameters: {{k: 10, c: 0.2}}, start: {{x: 1}}}}
  box: {{fmu: {asking}}}
connections:
  - mass.x -> box.u
coupling: {{scheme: gauss-seidel, step_ms: 10, interpolation: linear}}
run: {{stop_ms: 100}}
output: {{every_ms: 10}}
""")
    run_scenario(load_scenario(tmp_path / "line.yaml"), tmp_path, tmp_path / "out")
    series = np.genfromtxt(tmp_path / "out" / "timeseries.csv", delimiter=",", names=True)
    x = series["x"]
    assert np.ptp(x) > 0.01
    for k in range(1, 5):
        seen = series[f"u_at_{k}"]
        # Gauss–Seidel: the mass has stepped before the box does.
        np.testing.assert_allclose(seen[1:], x[:-1] + k / 4.0 * np.diff(x), rtol=1e-13)
