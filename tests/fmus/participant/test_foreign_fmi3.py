"""If these fail, the master misreads somebody else's FMU of FMI 3.0."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.participant import Abilities, Port
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mesh import Mesh
from pythonfmu3.builder import FmuBuilder

Join = Callable[..., FmuParticipant]

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


# --- other people's FMUs ---------------------------------------------------------------------------------------------


def test_arrays_scalars_and_a_structural_dimension(foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Arrays"])
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


def test_parameters_and_start_values_of_all_types(foreign: dict, ready: Join) -> None:
    # One value for an array is that of all its elements.
    given = {"gain": 10, "count": 7, "many": 2**40, "negate": True, "mode": "offset", "weights": 0.5}
    participant = ready(foreign["Arrays"], start={"u": 4.0, "x": 2.0}, **given)
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
def test_wrong_parameters_of_others(name: str, value: Any, message: str, foreign: dict, join: Join) -> None:
    with pytest.raises(InputError, match=f"^unit 'guest'.*{message}"):
        join(foreign["Arrays"], **{name: value})


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        (1.0, "it went 100% wrong, %s"),
        (2.0, r"fmi3DoStep failed with status 2 \(discard\)\. The FMU logged no reason"),
        # In FMI 3.0 a message is no format: nothing in it is undone.
        (3.0, "^only 50%% sure %s$"),
        (5.0, "it requested the end of the simulation"),
    ],
)
def test_steps_that_fail_in_other_peoples_fmus(mode: float, message: str, foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Failing"])
    participant.start(0.0, 0.1)
    participant.set("mode", np.array(mode))
    with pytest.raises(ParticipantError, match=message):
        participant.start(0.1, 0.1)


def test_a_warning_is_no_error(foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Failing"])
    participant.set("mode", np.array(4.0))
    participant.start(0.0, 0.1)
    assert participant.get("y") == 4.0


def test_after_a_fatal_error_the_fmu_is_not_touched_again(foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Failing"])
    participant.set("mode", np.array(1.0))
    with pytest.raises(ParticipantError):
        participant.start(0.0, 0.1)
    for call in (lambda: participant.get("y"), lambda: participant.start(0.0, 0.1)):
        with pytest.raises(ParticipantError, match="the FMU of unit 'guest' is closed"):
            call()


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
