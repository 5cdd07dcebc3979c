"""If these fail, the master misreads FMI 3.0 FMUs, ours or somebody else's, or a heart through them beats otherwise."""

import inspect
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.cli import app as cli
from cardiac_cosim.fmus.cache import cached_fmu
from cardiac_cosim.fmus.fmi3 import build
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError, RunError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.native import NativeParticipant
from cardiac_cosim.orchestrator.participants.participant import Abilities, Port
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from pythonfmu3.builder import FmuBuilder
from typer.testing import CliRunner

_DATA = Path(__file__).parent.parent.parent / "data"

_HEADER = """
import numpy as np
from pythonfmu3 import (
    Boolean, Dimension, Fmi3Causality, Fmi3Initial, Fmi3Slave, Fmi3Status, Fmi3StepResult, Fmi3Variability, Float64,
    Int32, Int64, String, UInt64,
)
INPUT, OUTPUT, PARAMETER = Fmi3Causality.input, Fmi3Causality.output, Fmi3Causality.parameter
CONTINUOUS, DISCRETE, FIXED = Fmi3Variability.continuous, Fmi3Variability.discrete, Fmi3Variability.fixed
"""

# Somebody else's FMUs, as plain pythonfmu3 makes them: no annotations, no units of measure, its own kind of state.
_FOREIGN = {
    "Arrays": """
class Arrays(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.n, self.x, self.u = 0.0, 4, np.zeros((2, 3)), 0.5
        self.y, self.total, self.number = np.zeros(4), 0.0, 7
        self.weights, self.gain, self.count, self.many = np.ones(3), 2.0, 3, 5
        self.negate, self.mode = False, "plain"
        two, three = Dimension(start="2"), Dimension(start="3")
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=CONTINUOUS))
        self.register_variable(
            UInt64("n", causality=Fmi3Causality.structuralParameter, variability=FIXED, initial=Fmi3Initial.exact)
        )
        # Its own setter of arrays calls NumPy by an argument that NumPy 2.4 does not have any more.
        self.register_variable(Float64(
            "x", causality=INPUT, variability=CONTINUOUS, dimensions=[two, three],
            setter=lambda values: setattr(self, "x", np.reshape(values, (2, 3))),
        ))
        self.register_variable(Float64("u", causality=INPUT, variability=CONTINUOUS))
        self.register_variable(
            Float64("y", causality=OUTPUT, variability=CONTINUOUS, dimensions=[Dimension(valueReference="1")])
        )
        self.register_variable(Float64("total", causality=OUTPUT, variability=CONTINUOUS))
        self.register_variable(Int32("number", causality=OUTPUT, variability=DISCRETE))
        fixed = dict(causality=PARAMETER, variability=FIXED)
        self.register_variable(Float64(
            "weights", dimensions=[three], setter=lambda values: setattr(self, "weights", np.array(values)), **fixed
        ))
        self.register_variable(Float64("gain", **fixed))
        self.register_variable(Int32("count", **fixed))
        self.register_variable(Int64("many", **fixed))
        self.register_variable(Boolean("negate", **fixed))
        self.register_variable(String("mode", **fixed))
    def do_step(self, t, h):
        self.total += h * self.u
        sign = -1 if self.negate else 1
        self.y = np.arange(4.0) + sign * self.gain * self.count * (self.x @ self.weights).sum() + self.many
        if self.mode == "offset":
            self.y = self.y + 1000.0
        return True
""",
    "Failing": """
class Failing(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.mode, self.y = 0.0, 0.0, 0.0
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=CONTINUOUS))
        self.register_variable(Float64("mode", causality=INPUT, variability=CONTINUOUS))
        self.register_variable(Float64("y", causality=OUTPUT, variability=CONTINUOUS))
    def do_step(self, t, h):
        if self.mode == 1:
            raise RuntimeError("it went 100% wrong, %s")
        if self.mode == 2:
            return Fmi3StepResult(status=Fmi3Status.discard)
        if self.mode == 3:
            self.log("only 50%% sure %s", Fmi3Status.error)
        if self.mode == 4:
            self.log("just so you know", Fmi3Status.warning)
        if self.mode == 5:
            return Fmi3StepResult(terminateSimulation=True)
        self.y = self.mode
        return True
""",
}


def _make(name: str, text: str, folder: Path) -> Path:
    script = folder / f"{name.lower()}_script3.py"
    script.write_text(_HEADER + inspect.cleandoc(text) + "\n")
    return FmuBuilder.build_FMU(script, folder, canGetAndSetFMUState=True, canSerializeFMUState=True)


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("foreign3")
    return {name: _make(name, text, folder) for name, text in _FOREIGN.items()}


@pytest.fixture
def join(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., FmuParticipant]]:
    """Make a participant; closed when the test ends, and then nothing is left of it on disk or on the path."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    made: list[FmuParticipant] = []
    path = list(sys.path)

    def make(file: Path, name: str = "guest", start: dict[str, Any] | None = None, **parameters: Any) -> FmuParticipant:
        made.append(FmuParticipant(name, file, parameters, start))
        return made[-1]

    yield make
    for participant in made:
        participant.close()
        # A second time does nothing.
        participant.close()
    assert list(folder.iterdir()) == []
    assert sys.path == path


def _ready(participant: FmuParticipant) -> FmuParticipant:
    participant.begin()
    participant.complete()
    return participant


# --- this project's FMUs ---------------------------------------------------------------------------------------------


def test_ports_abilities_and_values_are_those_of_the_native_participant(
    case: Any, fmus3: dict, join: Callable[..., FmuParticipant]
) -> None:
    native = NativeParticipant(case.unit, case.unit, case.mesh, case.parameters)
    packaged = join(fmus3[case.unit], case.unit, **case.parameters)
    assert packaged.inputs == native.inputs
    assert packaged.outputs == native.outputs
    assert packaged.abilities == native.abilities
    for participant in (native, packaged):
        participant.begin()
        for name, values in case.first().items():
            participant.set(name, values)
        participant.complete()
    for step, inputs in zip(case.steps, case.inputs, strict=True):
        for participant in (native, packaged):
            for name, values in inputs.items():
                participant.set(name, values)
            participant.start(*step)
        for name, port in packaged.outputs.items():
            values = packaged.get(name)
            assert values.shape == port.shape
            np.testing.assert_array_equal(values, native.get(name))


def test_states_go_back_and_into_another_instance(
    cases: dict, fmus3: dict, join: Callable[..., FmuParticipant]
) -> None:
    case = cases["electrophysiology"]
    one, other = (join(fmus3[case.unit], name, **case.parameters) for name in ("one", "other"))
    for participant in (one, other):
        participant.begin()
        for name, values in case.first().items():
            participant.set(name, values)
        participant.complete()
    one.start(*case.steps[0])
    saved, packed = one.save(), one.pack()
    one.start(1e-3, 1e-3)
    after = one.get("potential")
    one.restore(saved)
    assert (one.get("potential") != after).any()
    other.unpack(packed)
    for participant in (one, other):
        participant.start(1e-3, 1e-3)
        np.testing.assert_array_equal(participant.get("potential"), after)
    one.free(saved)
    with pytest.raises(ParticipantError, match="the state given to fmi3SetFMUState is none of this FMU"):
        other.unpack(packed[:100])


def test_a_failing_step_says_why(fmus3: dict, tiny: Mesh, join: Callable[..., FmuParticipant]) -> None:
    participant = _ready(join(fmus3["active_stress"], delay_function="seed"))
    participant.set("potential", np.full(tiny.nodes, 20.0))
    for _ in range(2):
        with pytest.raises(ParticipantError, match=r"at node 0 \(potential 20.0 mV\).*use delay_function: gompertz$"):
            participant.start(0.0, 1e-3)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (
            "delay_function",
            "100%",
            r"'delay_function' of type String cannot be '100%': .* is '100%'; choose one of: gom",
        ),
        ("slow_rate_per_ms", -1.0, r"'slow_rate_per_ms' of type Float64 cannot be -1.0: .*> 0"),
        ("length_dependence", "strong", "'length_dependence' of type Float64 cannot be 'strong'"),
        ("slow_rate", 1.0, "has no parameter 'slow_rate'; did you mean 'slow_rate_per_ms'"),
        ("potential", 1.0, "has no parameter 'potential'"),
    ],
)
def test_wrong_parameters_of_our_own(
    name: str, value: Any, message: str, fmus3: dict, join: Callable[..., FmuParticipant]
) -> None:
    with pytest.raises(InputError, match=f"^unit 'guest'.*{message}"):
        join(fmus3["active_stress"], **{name: value})


def test_a_field_of_the_wrong_shape_is_refused(fmus3: dict, tiny: Mesh, join: Callable[..., FmuParticipant]) -> None:
    participant = _ready(join(fmus3["active_stress"]))
    for values in (np.array(20.0), np.full(1, 20.0), np.full(tiny.nodes + 1, 20.0)):
        with pytest.raises(ParticipantError, match=r"'potential' of unit 'guest' got shape .*expected \(16,\)"):
            participant.set("potential", values)


def test_the_cache_keeps_both_versions_apart(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unit = UNITS["active_stress"]
    two, three = cached_fmu(unit, tiny, tmp_path), cached_fmu(unit, tiny, tmp_path, fmi=3)
    assert two != three
    assert two.name == three.name == "active_stress.fmu"
    assert cached_fmu(unit, tiny, tmp_path, fmi=3) == three
    before = build.fingerprint(unit, tiny)
    monkeypatch.setattr(build, "version", lambda name: f"another {name}")
    assert build.fingerprint(unit, tiny) != before
    with pytest.raises(ValueError, match="FMI 2 and 3, not 1"):
        cached_fmu(unit, tiny, tmp_path, fmi=1)


# --- other people's FMUs ---------------------------------------------------------------------------------------------


def test_arrays_scalars_and_a_structural_dimension(foreign: dict, join: Callable[..., FmuParticipant]) -> None:
    participant = _ready(join(foreign["Arrays"]))
    assert participant.inputs == {
        "x": Port("x", None, (2, 3), None, record="value"),
        "u": Port("u", None, (), "global", record="value"),
    }
    # A dimension that a structural parameter gives has its start value.
    assert participant.outputs == {
        "y": Port("y", None, (4,), None, record="value"),
        "total": Port("total", None, (), "global", record="value"),
        "number": Port("number", None, (), "global", record="value", type="Int32", discrete=True),
    }
    # As its description says, where pythonfmu3 leaves the step size fixed unless told otherwise.
    assert participant.abilities == Abilities(rolls_back=True, serializes=True, any_step_size=False)
    participant.set("x", np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]]))
    participant.start(0.0, 0.25)
    np.testing.assert_array_equal(participant.get("y"), np.arange(4.0) + 2.0 * 3 * 66.0 + 5)
    assert participant.get("total") == 0.25 * 0.5
    assert participant.get("total").shape == ()


def test_parameters_and_start_values_of_all_types(foreign: dict, join: Callable[..., FmuParticipant]) -> None:
    # One value for an array is that of all its elements.
    given = {"gain": 10, "count": 7, "many": 2**40, "negate": True, "mode": "offset", "weights": 0.5}
    participant = _ready(join(foreign["Arrays"], start={"u": 4.0, "x": 2.0}, **given))
    participant.start(0.0, 0.5)
    assert participant.get("total") == 2.0
    np.testing.assert_array_equal(participant.get("y"), np.arange(4.0) - 10 * 7 * 6 * 2.0 * 0.5 + 2**40 + 1000.0)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("gain", "2", "'gain' of type Float64 cannot be '2'"),
        ("gain", True, "'gain' of type Float64 cannot be True"),
        ("count", 2.5, "'count' of type Int32 cannot be 2.5"),
        ("count", 2**31, "'count' of type Int32 cannot be 2147483648"),
        ("many", 2**63, "'many' of type Int64 cannot be 9223372036854775808"),
        ("negate", 1, "'negate' of type Boolean cannot be 1"),
        ("mode", 5, "'mode' of type String cannot be 5"),
        ("weights", "x", "'weights' of type Float64 cannot be 'x'"),
        ("n", 5, "'n' is a structural parameter, which keeps its start value here; remove it"),
        ("gian", 1.0, "has no parameter 'gian'; did you mean 'gain'"),
        ("u", 1.0, "has no parameter 'u'"),
    ],
)
def test_wrong_parameters_of_others(
    name: str, value: Any, message: str, foreign: dict, join: Callable[..., FmuParticipant]
) -> None:
    with pytest.raises(InputError, match=f"^unit 'guest'.*{message}"):
        join(foreign["Arrays"], **{name: value})


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        (1.0, "it went 100% wrong, %s"),
        (2.0, r"fmi3DoStep failed with status 2 \(discard\)\. The FMU logged no reason"),
        # In FMI 3.0 a message is no format: nothing in it is undone.
        (3.0, "^only 50%% sure %s$"),
        (5.0, "it asks for the end of the simulation"),
    ],
)
def test_steps_that_fail_in_other_peoples_fmus(
    mode: float, message: str, foreign: dict, join: Callable[..., FmuParticipant]
) -> None:
    participant = _ready(join(foreign["Failing"]))
    participant.start(0.0, 0.1)
    participant.set("mode", np.array(mode))
    with pytest.raises(ParticipantError, match=message):
        participant.start(0.1, 0.1)


def test_a_warning_is_no_error(foreign: dict, join: Callable[..., FmuParticipant]) -> None:
    participant = _ready(join(foreign["Failing"]))
    participant.set("mode", np.array(4.0))
    participant.start(0.0, 0.1)
    assert participant.get("y") == 4.0


def test_after_a_fatal_error_the_fmu_is_not_touched_again(foreign: dict, join: Callable[..., FmuParticipant]) -> None:
    participant = _ready(join(foreign["Failing"]))
    participant.set("mode", np.array(1.0))
    with pytest.raises(ParticipantError):
        participant.start(0.0, 0.1)
    for call in (lambda: participant.get("y"), lambda: participant.start(0.0, 0.1)):
        with pytest.raises(ParticipantError, match="the FMU of unit 'guest' is closed"):
            call()


# --- scenarios -------------------------------------------------------------------------------------------------------

_HEART = f"""\
name: small
scene: {{mesh: {_DATA / "biventricle_12mm.msh"}}}
units:
  fibers: {{unit: fiber_generator}}
  electrophysiology: {{unit: electrophysiology, parameters: {{stimulus_depth_mm: 2}}}}
  active_stress: {{unit: active_stress}}
  mechanics: {{unit: mechanics}}
run: {{stop_ms: 10}}
output: {{probes_mm: {{base: [25, 0, -1]}}}}
"""

_SCHEMES = {
    "explicit": (),
    "parallel": ("coupling.scheme=jacobi", "coupling.interpolation=linear", "coupling.extrapolation=1"),
    "iterated": (
        "coupling.step_ms=5",
        "coupling.iterate={acceleration: anderson, converge: {stretch: {relative: 1e-4}}}",
    ),
    "adaptive": ("coupling.adaptive={tolerance: 0.1}",),
}


@pytest.mark.parametrize("scheme", _SCHEMES)
def test_a_heart_through_fmi_3_beats_as_by_direct_calls(scheme: str, tmp_path: Path) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    series = {}
    for participants in ("native", "fmu3"):
        sets = (*_SCHEMES[scheme], f"run.participants={participants}")
        scenario = load_scenario(tmp_path / "heart.yaml", sets)
        run_scenario(scenario, tmp_path, tmp_path / participants, fmu_dir=tmp_path / "fmus")
        series[participants] = (tmp_path / participants / "timeseries.csv").read_text()
    assert series["fmu3"] == series["native"]
    assert len(series["fmu3"].splitlines()) > 2


def test_an_interrupted_run_goes_on_to_the_same_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    sets = ["run.participants=fmu3", "run.checkpoint_every=4"]
    scenario = load_scenario(tmp_path / "heart.yaml", sets)
    run_scenario(scenario, tmp_path, tmp_path / "whole", fmu_dir=tmp_path / "fmus")
    step = FmuParticipant.start

    def failing(self: FmuParticipant, time: float, size: float) -> Any:
        if time > 0.0065:
            raise ParticipantError("pulled the plug")
        return step(self, time, size)

    with monkeypatch.context() as patch:
        patch.setattr(FmuParticipant, "start", failing)
        with pytest.raises(RunError, match="pulled the plug"):
            run_scenario(scenario, tmp_path, tmp_path / "parts", fmu_dir=tmp_path / "fmus")
    assert json.loads((tmp_path / "parts" / "summary.json").read_text())["resumable"] is True
    run_scenario(scenario, tmp_path, tmp_path / "parts", fmu_dir=tmp_path / "fmus", resume=True)
    assert (tmp_path / "parts" / "timeseries.csv").read_text() == (tmp_path / "whole" / "timeseries.csv").read_text()


def test_what_cosim_build_makes_takes_a_units_place(tmp_path: Path) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    built = CliRunner().invoke(
        cli.app, ["build", str(tmp_path / "heart.yaml"), "--fmi", "3", "--output", str(tmp_path / "fmus3")]
    )
    assert built.exit_code == 0, built.output
    names = ["fiber_generator", "electrophysiology", "active_stress", "mechanics"]
    assert sorted(path.name for path in (tmp_path / "fmus3").iterdir()) == sorted(f"{name}.fmu" for name in names)
    text = _HEART
    for name in names:
        text = text.replace(f"unit: {name}", f"fmu: fmus3/{name}.fmu")
    assert "unit:" not in text
    (tmp_path / "fmus.yaml").write_text(text)
    for name, sets in (("heart", ["run.participants=native"]), ("fmus", [])):
        run_scenario(load_scenario(tmp_path / f"{name}.yaml", sets), tmp_path, tmp_path / name)
    assert (tmp_path / "fmus" / "timeseries.csv").read_text().count("\n") == 12
    heart, fmus = (np.genfromtxt(tmp_path / name / "timeseries.csv", delimiter=",") for name in ("heart", "fmus"))
    np.testing.assert_array_equal(heart[1:], fmus[1:])


def test_files_for_libcosim_and_containers_are_of_fmi_2_only(tmp_path: Path) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    for option in ("--osp", "--container"):
        arguments = ["build", str(tmp_path / "heart.yaml"), "--fmi", "3", option, "--output", str(tmp_path / "out")]
        result = CliRunner().invoke(cli.app, arguments)
        assert isinstance(result.exception, InputError)
        assert "are for FMUs of FMI 2.0" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_foreign_fmus_of_both_versions_in_one_scenario(
    foreign: dict, fmus: dict, fmus3: dict, tiny: Mesh, tmp_path: Path
) -> None:
    """Our active stress of FMI 2.0 is fed by our potential of FMI 3.0; somebody else's integrator listens."""
    (tmp_path / "mixed.yaml").write_text(f"""\
name: mixed
units:
  fibers: {{fmu: {fmus3["fiber_generator"]}}}
  electrophysiology: {{fmu: {fmus3["electrophysiology"]}, parameters: {{stimulus_depth_mm: 20}}}}
  active_stress: {{fmu: {fmus["active_stress"]}}}
  listener: {{fmu: {foreign["Arrays"]}}}
connections:
  - active_stress.active_stress_mean -> listener.u
run: {{stop_ms: 10}}
""")
    run_scenario(load_scenario(tmp_path / "mixed.yaml"), tmp_path, tmp_path / "out")
    series = np.genfromtxt(tmp_path / "out" / "timeseries.csv", delimiter=",", names=True)
    stress = {name: series[name] for name in series.dtype.names if "active_stress_mean" in name}
    (mean,) = stress.values()
    (total,) = (series[name] for name in series.dtype.names if "total" in name)
    assert mean[-1] > 0.0
    # The listener steps after the stress (Gauss–Seidel), so that it sums up the values at the ends of the steps.
    np.testing.assert_allclose(total, 1e-3 * np.concatenate([[0.0], np.cumsum(mean[1:])]), rtol=1e-12)
