"""If these fail, our wrapper crashes hosts, hides why something failed, or is not what FMI 2.0 describes."""

import ctypes
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from cardiac_cosim.fmus import build, wrapper
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

_SOURCES = Path(wrapper.__file__).parent
_HEADERS = Path(fmpy.__file__).parent / "c-code"


@pytest.fixture(scope="module")
def unpacked(tiny: Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The active stress FMU with our wrapper, extracted to a folder whose name has to be encoded in a URI."""
    folder = tmp_path_factory.mktemp("own") / "an FMU, 100% ours"
    fmpy.extract(str(build.build_fmu(UNITS["active_stress"], tiny, folder.parent / "x.fmu")), str(folder))
    return folder


class Host:
    """Calls the binary as a C program would: no FMPy class in between."""

    def __init__(self, folder: Path) -> None:
        self.description = fmpy.read_model_description(str(folder), validate=False)
        self.dll = ctypes.CDLL(str(folder / "binaries" / "linux64" / "active_stress.so"))
        self.dll.fmi2Instantiate.restype = ctypes.c_void_p
        self.said: list[tuple[int, str]] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(
            lambda _environment, _name, status, _category, message: self.said.append((status, message.decode()))
        )

    def instantiate(self, location: str, name: str = "x", kind: int = 1, guid: str | None = None) -> int | None:
        return self.dll.fmi2Instantiate(  # type: ignore[no-any-return]
            name.encode(),
            kind,
            (self.description.guid if guid is None else guid).encode(),
            location.encode(),
            ctypes.byref(self.callbacks),
            0,
            0,
        )

    def free(self, instance: int) -> None:
        self.dll.fmi2FreeInstance(ctypes.c_void_p(instance))


@pytest.mark.parametrize("form", ["file://", "file:", "file://localhost", ""])
def test_every_form_of_the_resources_location(form: str, unpacked: Path) -> None:
    host = Host(unpacked)
    resources = unpacked / "resources"
    location = resources.as_uri().removeprefix("file://") if form else str(resources)
    instance = host.instantiate(form + location + "/" * (form == "file:"))
    assert instance, host.said
    host.free(instance)
    assert host.said == []


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"location": "https://somewhere/else"}, "no file load.py in the resources of the FMU, https://somewhere/else"),
        ({"location": "file:///nowhere"}, "no file load.py in the resources of the FMU, /nowhere"),
        ({"location": "file://nowhere"}, "the location of the resources is no file: URI"),
        ({"name": ""}, "an instance needs a name"),
        ({"kind": 0}, "for co-simulation only"),
        ({"guid": "{100%}"}, "the GUID {100%%} is not that of this FMU"),
    ],
)
def test_what_is_wrong_with_an_instance_is_logged(given: dict[str, Any], message: str, unpacked: Path) -> None:
    host = Host(unpacked)
    assert host.instantiate(**({"location": (unpacked / "resources").as_uri()} | given)) is None
    ((status, text),) = host.said
    assert status == 3
    assert message in text


def test_damaged_resources_are_told(unpacked: Path, tmp_path: Path) -> None:
    broken = tmp_path / "resources"
    shutil.copytree(unpacked / "resources", broken)
    host = Host(unpacked)
    for text, message in (
        ("def instantiate(:", "invalid syntax"),
        ("1 / 0", "division by zero"),
        ("", "null argument"),
    ):
        (broken / "load.py").write_text(text)
        assert host.instantiate(broken.as_uri()) is None
        assert message in host.said.pop()[1]
    (broken / "load.py").write_text("def instantiate(resources, guid):\n    return 5")
    instance = host.instantiate(broken.as_uri())
    assert instance is not None
    assert host.dll.fmi2EnterInitializationMode(ctypes.c_void_p(instance)) == 3
    assert host.said.pop() == (3, "'int' object has no attribute 'enter_initialization_mode'")
    host.free(instance)


def test_failures_are_told_to_hosts_that_asked_for_no_log(unpacked: Path) -> None:
    host = Host(unpacked)
    instance = ctypes.c_void_p(host.instantiate((unpacked / "resources").as_uri()))
    values = (ctypes.c_double * 1)()
    assert host.dll.fmi2GetReal(instance, (ctypes.c_uint * 1)(10**6), ctypes.c_size_t(1), values) == 3
    assert np.isnan(values[0])
    ((status, text),) = host.said
    assert (status, text) == (3, "unit 'active_stress' has no value reference 1000000")
    host.free(instance.value)


@pytest.fixture
def slave(tiny: Mesh, unpacked: Path) -> FMU2Slave:
    host = Host(unpacked)
    fmu = FMU2Slave(
        guid=host.description.guid, unzipDirectory=str(unpacked), modelIdentifier="active_stress", instanceName="x"
    )
    fmu.instantiate(callbacks=host.callbacks)
    fmu.host = host
    yield fmu
    fmu.freeInstance()


def test_what_is_asked_after_a_step_that_failed(slave: FMU2Slave, tiny: Mesh) -> None:
    (choice,) = [v for v in slave.host.description.modelVariables if v.name == "delay_function"]
    slave.setString([choice.valueReference], ["seed"])
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    slave.doStep(0.0, 0.25)
    assert slave.getRealStatus(2) == 0.25
    potential = [v.valueReference for v in slave.host.description.modelVariables if v.name.startswith("potential[")]
    slave.setReal(potential, [20.0] * len(potential))
    with pytest.raises(fmpy.fmi1.FMICallException) as failure:
        slave.doStep(0.25, 0.25)
    assert failure.value.status == 2
    assert slave.getRealStatus(2) == 0.25
    assert slave.getBooleanStatus(3) == 0


def test_what_no_unit_can_is_an_error_that_says_so(slave: FMU2Slave) -> None:
    for call, message in (
        (lambda: slave.setRealInputDerivatives([0], [1], [0.0]), "input_interpolation"),
        (lambda: slave.getRealOutputDerivatives([0], [1]), "maxOutputDerivativeOrder is 0"),
        (lambda: slave.getDirectionalDerivative([0], [0], [0.0]), "providesDirectionalDerivative is false"),
        (slave.cancelStep, "cannot be cancelled"),
    ):
        with pytest.raises(fmpy.fmi1.FMICallException):
            call()
        assert message in slave.host.said.pop()[1]


def test_an_overwritten_state_is_freed(slave: FMU2Slave) -> None:
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    state = slave.getFMUstate()
    stored = slave.serializeFMUstate(state)
    slave.fmi2GetFMUstate(slave.component, ctypes.byref(state))
    assert slave.serializeFMUstate(state) == stored
    slave.freeFMUstate(state)
    assert state.value is None
    slave.freeFMUstate(state)


# --- the sources -----------------------------------------------------------------------------------------------------


def test_it_agrees_with_the_headers_of_the_standard() -> None:
    command = ["cc", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-DCOSIM_STANDARD_HEADERS", f"-I{_HEADERS}"]
    subprocess.run([*command, str(_SOURCES / "fmi2.c")], check=True)


def test_it_has_every_function_of_co_simulation() -> None:
    # Those of the header, but for what only model exchange has.
    text = (_HEADERS / "fmi2FunctionTypes.h").read_text()
    shared = text.split("Types for Functions for FMI2 for Model Exchange")[0]
    own = text.split("Types for Functions for FMI2 for Co-Simulation")[1]
    names = {word.split("TYPE")[0] for word in (shared + own).replace("(", " ").split() if word.startswith("fmi2")}
    functions = {name for name in names if name[4:5].isupper() and f"{name}TYPE" in text}
    assert len(functions) > 30
    dll = ctypes.CDLL(str(wrapper.library()))
    assert not [name for name in sorted(functions) if not hasattr(dll, name)]


def test_every_supported_python_has_the_functions_it_takes() -> None:
    text = (_SOURCES / "python.h").read_text()
    names = [line.split(",")[1].strip() for line in text.splitlines() if line.startswith("    X(")]
    assert len(names) > 25
    assert not [name for name in names if not hasattr(ctypes.pythonapi, name)]


# --- environments ----------------------------------------------------------------------------------------------------


def test_a_python_that_lacks_a_package_is_told_which(tiny: Mesh, unpacked: Path) -> None:
    text = f"""
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "skfem":
            raise ModuleNotFoundError("No module named 'skfem'", name="skfem")
sys.meta_path.insert(0, Blocker())
import ctypes
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
callbacks = fmi2CallbackFunctions()
callbacks.logger = fmi2CallbackLoggerTYPE(lambda a, b, status, d, message: print(message.decode()))
folder = {str(unpacked)!r}
description = read_model_description(folder, validate=False)
fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="active_stress", instanceName="x")
try:
    fmu.instantiate(callbacks=callbacks)
except Exception as error:
    print("refused")
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, timeout=60)
    message, refused = done.stdout.splitlines()
    assert refused == "refused"
    assert message.startswith("this FMU needs the Python package 'skfem', which the Python ")


def test_a_host_that_has_another_pythonfmu_does_not_matter(
    tiny: Mesh, outside: Callable[..., str], unpacked: Path, tmp_path: Path
) -> None:
    path = build.build_fmu(UNITS["active_stress"], tiny, tmp_path / "x.fmu")
    with zipfile.ZipFile(path) as archive:
        assert not [name for name in archive.namelist() if "pythonfmu" in name]
    text = """
import sys, types
sys.modules["pythonfmu"] = types.ModuleType("pythonfmu")
driver = Driver(sys.argv[1])
driver.start({}, {})
print(driver.step(0.0, 1e-3), driver.messages)
driver.close()
"""
    assert outside(text, path) == "0 []\n"
