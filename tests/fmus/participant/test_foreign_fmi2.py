"""If these fail, the master misreads somebody else's FMU of FMI 2.0, or leaves its files behind."""

import inspect
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.participant import Port
from cardiac_cosim.units.mesh import Mesh
from pythonfmu.builder import FmuBuilder

Join = Callable[..., FmuParticipant]

_HEADER = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String
from pythonfmu.enums import Fmi2Status
"""

# Somebody else's FMUs, as plain PythonFMU makes them: no unit definitions, no annotations, no state.
_FOREIGN = {
    "Scalars": """
class Scalars(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.gain, self.count, self.negate, self.mode = 0.5, 0.0, 2.0, 3, False, "plain"
        parameter = dict(causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("gain", **parameter))
        self.register_variable(Integer("count", **parameter))
        self.register_variable(Boolean("negate", **parameter))
        self.register_variable(String("mode", **parameter))
    def do_step(self, t, h):
        self.y = self.u * self.gain * self.count * (-1 if self.negate else 1) + (100 if self.mode == "offset" else 0)
        return True
""",
    # Declared backwards, with a stranger between the elements: neither order nor value references are consecutive.
    "Arrays": """
class Arrays(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x = {(i, j): 0.0 for i in (1, 2) for j in (1, 2, 3)}
        self.v = {k: 0.0 for k in range(1, 12)}
        self.other = 7.0
        def real(name, values, key, causality):
            self.register_variable(Real(
                name, causality=causality, getter=lambda: values[key], setter=lambda value: values.update({key: value})
            ), nested=False)
        for key in reversed(list(self.x)):
            real(f"x[{key[0]},{key[1]}]", self.x, key, Fmi2Causality.input)
            if key == (2, 1):
                self.register_variable(Real("other", causality=Fmi2Causality.output))
        for key in (10, 2, 1, 11, 3, 9, 8, 4, 5, 7, 6):
            real(f"a.v[{key}]", self.v, key, Fmi2Causality.output)
    def do_step(self, t, h):
        for key in self.v:
            self.v[key] = 1000.0 * key + 100 * self.x[1, 1] + 10 * self.x[1, 3] + self.x[2, 1]
        return True
""",
    "Failing": """
class Failing(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.mode = 0.0
        self.register_variable(Real("mode", causality=Fmi2Causality.input))
        self.register_variable(Real("mode2", causality=Fmi2Causality.output, getter=lambda: self.mode), nested=False)
    def do_step(self, t, h):
        if self.mode == 1:
            raise RuntimeError("it went 100% wrong, %s")
        if self.mode == 2:
            return False
        if self.mode == 3:
            self.log("only 50% sure %s", Fmi2Status.error)
        if self.mode == 4:
            self.log("just so you know", Fmi2Status.warning)
        if self.mode == 5:
            self.log("x" * 9000 + " the end", Fmi2Status.error)
        return True
""",
}


# Can be built and described, but not instantiated.
_MOODY = """
class Moody(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        if self.instance_name != "dummyInstance":
            raise RuntimeError("not today, 0% chance")
    def do_step(self, t, h):
        return True
"""


def _gapped(kind: str) -> str:
    names = {
        "missing": ["x[1]", "x[2]", "x[4]"],
        "hole of a matrix": ["x[1,1]", "x[1,3]", "x[2,1]", "x[2,2]"],
        "from zero": ["x[0]", "x[1]"],
        "scalar and array": ["x", "x[1]"],
        "mixed": ["x[1]", "x[1,1]"],
        "wild": ["x[1]", "x[4000000000]"],
    }[kind]
    return f"""
class Gapped(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for name in {names}:
            self.register_variable(Real(name, causality=Fmi2Causality.output, getter=lambda: 1.0), nested=False)
    def do_step(self, t, h):
        return True
"""


def _make(name: str, text: str, folder: Path) -> Path:
    script = folder / f"{name.lower()}_script.py"
    script.write_text(_HEADER + inspect.cleandoc(text) + "\n")
    path, modules = list(sys.path), set(sys.modules)
    try:
        return FmuBuilder.build_FMU(script, folder / f"{name}.fmu")
    finally:
        sys.path[:] = path
        for module in set(sys.modules) - modules:
            if module == script.stem:
                del sys.modules[module]


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("foreign")
    return {name: _make(name, text, folder) for name, text in _FOREIGN.items()}


# --- other people's FMUs ---------------------------------------------------------------------------------------------


def test_scalars_without_units(foreign: dict, join: Join) -> None:
    participant = join(foreign["Scalars"])
    assert participant.inputs == {"u": Port("u", None, (), "global", record="value")}
    assert participant.outputs == {"y": Port("y", None, (), "global", record="value")}
    participant.begin()
    participant.complete()
    participant.start(0.0, 0.1)
    # With the start values of its own.
    assert participant.get("y") == 0.5 * 2.0 * 3
    participant.set("u", np.array(4.0))
    participant.start(0.1, 0.1)
    assert participant.get("y") == 4.0 * 2.0 * 3
    assert participant.get("y").shape == ()


def test_parameters_of_all_types(foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Scalars"], gain=10, count=7, negate=True, mode="offset")
    participant.set("u", np.array(2.0))
    participant.start(0.0, 0.1)
    assert participant.get("y") == -2.0 * 10.0 * 7 + 100.0


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("gain", "2", "'gain' of type Real cannot be '2'"),
        ("gain", True, "'gain' of type Real cannot be True"),
        ("gain", None, "'gain' of type Real cannot be None"),
        ("count", 2.5, "'count' of type Integer cannot be 2.5"),
        ("count", True, "'count' of type Integer cannot be True"),
        ("count", 2**32 + 3, "'count' of type Integer cannot be 4294967299"),
        ("negate", 1, "'negate' of type Boolean cannot be 1"),
        ("negate", "no", "'negate' of type Boolean cannot be 'no'"),
        ("mode", 5, "'mode' of type String cannot be 5"),
        ("mode", "off\0set", "'mode' of type String cannot be"),
        ("gian", 1.0, "has no parameter 'gian'; did you mean 'gain'"),
        ("u", 1.0, "has no parameter 'u'"),
    ],
)
def test_wrong_parameters_of_others(name: str, value: Any, message: str, foreign: dict, join: Join) -> None:
    with pytest.raises(InputError, match=f"^unit 'guest'.*{message}"):
        join(foreign["Scalars"], **{name: value})


def test_arrays_in_any_order(foreign: dict, join: Join) -> None:
    participant = join(foreign["Arrays"])
    assert {name: port.shape for name, port in participant.inputs.items()} == {"x": (2, 3)}
    assert {name: port.shape for name, port in participant.outputs.items()} == {"other": (), "a.v": (11,)}
    assert (participant.inputs["x"].unit, participant.inputs["x"].location) == (None, None)
    assert participant.outputs["a.v"].record == "value"
    participant.begin()
    participant.complete()
    participant.set("x", np.array([[1.0, -1.0, 3.0], [4.0, -1.0, -1.0]]))
    participant.start(0.0, 0.1)
    np.testing.assert_array_equal(participant.get("a.v"), 1000.0 * np.arange(1, 12) + 134.0)
    assert participant.get("other") == 7.0


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("missing", {"x[1]", "x[2]", "x[4]"}),
        ("hole of a matrix", {"x[1,1]", "x[1,3]", "x[2,1]", "x[2,2]"}),
        ("from zero", {"x"}),
        ("scalar and array", {"x", "x[1]"}),
        ("mixed", {"x[1]", "x[1,1]"}),
        ("wild", {"x[1]", "x[4000000000]"}),
    ],
)
def test_names_that_fill_no_array_are_scalars(kind: str, names: set[str], tmp_path: Path, ready: Join) -> None:
    # Of two scripts of one name PythonFMU would run the first twice.
    participant = ready(_make(f"Gapped_{kind.replace(' ', '_')}", _gapped(kind), tmp_path))
    assert participant.outputs.keys() == names
    for name, port in participant.outputs.items():
        assert (port.shape, port.base) == ((), 1) if kind != "from zero" else ((2,), 0)
        np.testing.assert_array_equal(participant.get(name), np.ones(port.shape))
    if kind == "from zero":
        assert participant.get("x[0]") == 1.0
        with pytest.raises(ParticipantError, match=r"no variable 'x\[2\]'"):
            participant.get("x[2]")


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        (1.0, r"it went 100% wrong, %s"),
        # PythonFMU's wrapper says of a step that returns False that it is the end.
        (2.0, r"it requested the end of the simulation \(fmi2Terminated\)"),
        (3.0, r"^only 50% sure %s$"),
        (5.0, r"^x{9000} the end$"),
    ],
)
def test_steps_that_fail_in_other_peoples_fmus(mode: float, message: str, foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Failing"])
    participant.start(0.0, 0.1)
    participant.set("mode", np.array(mode))
    with pytest.raises(ParticipantError, match=message):
        participant.start(0.1, 0.1)


def test_messages_are_not_mixed_up_with_those_of_our_fmus(fmus: dict, foreign: dict, tiny: Mesh, ready: Join) -> None:
    own = ready(fmus["active_stress"], "own", delay_function="as_printed")
    stranger = ready(foreign["Failing"], "stranger")
    own.set("potential", np.full(tiny.nodes, 10.0))
    stranger.set("mode", np.array(3.0))
    for _ in range(2):
        with pytest.raises(ParticipantError, match=r"10\.0 mV"):
            own.start(0.0, 1e-3)
        with pytest.raises(ParticipantError, match=r"^only 50% sure %s$"):
            stranger.start(0.0, 1e-3)


def test_a_warning_is_no_error(foreign: dict, ready: Join) -> None:
    participant = ready(foreign["Failing"])
    participant.set("mode", np.array(4.0))
    participant.start(0.0, 0.1)
    assert participant.get("mode2") == 4.0


def test_after_a_fatal_error_the_fmu_is_not_touched_again(
    foreign: dict, outside: Callable[..., str], ready: Join
) -> None:
    participant = ready(foreign["Failing"])
    participant.set("mode", np.array(1.0))
    with pytest.raises(ParticipantError):
        participant.start(0.0, 0.1)
    for call in (lambda: participant.get("mode2"), lambda: participant.start(0.0, 0.1)):
        with pytest.raises(ParticipantError, match="the FMU of unit 'guest' is closed"):
            call()
    # Many times in one process, which then ends as it should.
    text = """
import sys
from pathlib import Path
import numpy as np
from cardiac_cosim.orchestrator.errors import ParticipantError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
for _ in range(20):
    participant = FmuParticipant("guest", Path(sys.argv[1]), {})
    participant.begin()
    participant.complete()
    participant.set("mode", np.array(1.0))
    try:
        participant.start(0.0, 0.1)
    except ParticipantError:
        participant.close()
print("done")
"""
    assert outside(text, foreign["Failing"], block=False) == "done\n"


# --- files that are no such FMU --------------------------------------------------------------------------------------


def _edited(source: Path, target: Path, change: Callable[[str], str], drop: str = "nothing") -> Path:
    """`source` with another model description and without the members whose name begins with `drop`."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = change(content.decode()).encode()
            if not name.startswith(drop):
                new.writestr(name, content)
    return target


def _damaged(source: Path, target: Path) -> Path:
    """`source` with one byte changed in its largest member, behind the model description's back."""
    with zipfile.ZipFile(source) as archive:
        largest = max(archive.infolist(), key=lambda member: member.compress_size)
    content = bytearray(source.read_bytes())
    content[largest.header_offset + 200 + largest.compress_size // 2] ^= 255
    target.write_bytes(content)
    return target


_FMI3 = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
<CoSimulation modelIdentifier="m"/><ModelVariables><Float64 name="time" valueReference="0" causality="independent"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


_FMI1 = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="1.0" modelName="m" modelIdentifier="m" guid="g" numberOfContinuousStates="0"
 numberOfEventIndicators="0"><ModelVariables/><Implementation><CoSimulation_StandAlone><Capabilities/>
</CoSimulation_StandAlone></Implementation></fmiModelDescription>"""


def _file(kind: str, source: Path, folder: Path) -> Path:
    path = folder / "guest.fmu"
    if kind == "missing":
        return path
    if kind == "folder":
        return folder
    if kind in ("text", "empty"):
        path.write_text("this is no archive" if kind == "text" else "")
    elif kind == "cut":
        path.write_bytes(source.read_bytes()[:5000])
    elif kind == "no description":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("readme.txt", "hello")
    elif kind == "damaged":
        _damaged(source, path)
    elif kind == "moody":
        return _make("Moody", _MOODY, folder)
    else:
        change, drop = {
            "FMI 1": (lambda text: _FMI1, "nothing"),
            "FMI 3 without binary": (lambda text: _FMI3, "nothing"),
            "model exchange": (lambda text: text.replace("CoSimulation", "ModelExchange"), "nothing"),
            "no XML": (lambda text: text[:300], "nothing"),
            "no binary": (lambda text: text, "binaries/"),
        }[kind]
        _edited(source, path, change, drop)
    return path


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("missing", "no such FMU"),
        ("folder", "this folder has no modelDescription.xml"),
        ("text", "not a zip archive, or it is damaged"),
        ("empty", "not a zip archive, or it is damaged"),
        ("cut", "not a zip archive, or it is damaged"),
        ("no description", "this archive has no modelDescription.xml"),
        ("no XML", "modelDescription.xml: it is not well-formed XML"),
        ("FMI 1", "an FMU of FMI 1.0, which is not supported"),
        ("FMI 3 without binary", r"no library for this platform, x86_64-linux, only for linux64, win64"),
        ("model exchange", "an FMU for model exchange only"),
        ("damaged", "its member .* is damaged"),
        ("no binary", "no library for this platform, linux64, nor for any other"),
        ("moody", r"(?s)cannot be instantiated: .*not today, 0% chance"),
    ],
)
def test_files_that_are_no_fmu_for_us(
    kind: str, message: str, foreign: dict, tmp_path: Path, temporary: Path, join: Join
) -> None:
    path = _file(kind, foreign["Scalars"], tmp_path)
    with pytest.raises(InputError, match=message) as refusal:
        join(path)
    assert str(refusal.value).startswith(f"unit 'guest': {path}: ")
    assert list(temporary.iterdir()) == []
