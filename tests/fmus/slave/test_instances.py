"""If these fail, an FMU needs this project, or FMUs in one process run each other's code or share states."""

import ctypes
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus import build
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Make = Callable[..., Any]


def test_it_runs_where_this_project_is_not(
    case: Any, packed: dict, outside: Callable[..., str], tmp_path: Path
) -> None:
    np.savez(
        tmp_path / "in.npz", **case.fixed, **{f"{n}/{k}": v for n, i in enumerate(case.inputs) for k, v in i.items()}
    )
    text = """
import sys, ast
import numpy as np
try:
    import cardiac_cosim.units
except ImportError:
    pass
else:
    raise SystemExit("the project can be imported: this proves nothing")
given = dict(np.load(sys.argv[2]))
parameters, steps = ast.literal_eval(sys.argv[4]), ast.literal_eval(sys.argv[5])
driver = drive(sys.argv[1])
varying = lambda n: {key.split("/")[1]: value for key, value in given.items() if key.startswith(f"{n}/")}
driver.start(parameters, {key: value for key, value in given.items() if "/" not in key} | varying(0))
seen = {f"0/{name}": values for name, values in driver.outputs().items()}
for n, (time, size) in enumerate(steps):
    assert driver.step(time, size, varying(n)) == 0, driver.errors()
    seen |= {f"{n + 1}/{name}": values for name, values in driver.outputs().items()}
assert not driver.messages and not driver.refused
assert not [name for name in sys.modules if name.startswith("cardiac_cosim")]
np.savez(sys.argv[3], **seen)
driver.close()
"""
    outside(text, packed[case.unit], tmp_path / "in.npz", tmp_path / "out.npz", case.parameters, case.steps)
    with np.load(tmp_path / "out.npz") as seen:
        for number, expected in enumerate(case.expected):
            case.compare({name: seen[f"{number}/{name}"] for name in expected}, number)


def test_all_units_of_both_versions_in_one_process_and_two_of_each(
    fmus: dict, fmus3: dict, cases: dict, drive: Make
) -> None:
    pairs = [
        (drive(paths[name], f"{name} {k}"), cases[name]) for paths in (fmus, fmus3) for k in range(2) for name in UNITS
    ]
    for driver, case in pairs:
        driver.start(case.parameters, case.first())
    for number in range(4):
        for driver, case in pairs:
            assert driver.step(*case.steps[number], case.inputs[number]) == 0
        for driver, case in pairs:
            case.compare(driver.outputs(), number + 1)


def test_instances_of_one_fmu_share_nothing(stepping: Any, make: Make) -> None:
    one, other = make(stepping.unit, "one"), make(stepping.unit, "other")
    one.start(stepping.parameters, stepping.first())
    other.start({}, stepping.first())
    assert one.step(*stepping.steps[0], stepping.inputs[0]) == 0
    assert other.step(0.0, 5e-3, stepping.inputs[3]) == 0
    stepping.compare(one.outputs(), 1)
    assert other.outputs() != one.outputs()
    stepping.run(one, first=1)


def test_two_versions_of_the_code_in_one_process_run_their_own(
    fmi: int, tiny: Mesh, packed: dict, cases: dict, drive: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = build.sources()
    changed = files["units/active_stress.py"].replace(b"_KPA_PER_MPA = 1000.0", b"_KPA_PER_MPA = 2000.0")
    assert changed != files["units/active_stress.py"]
    monkeypatch.setattr(build, "sources", lambda: files | {"units/active_stress.py": changed})
    other = build_fmu(UNITS["active_stress"], tiny, tmp_path / "active_stress.fmu", fmi)
    case = cases["active_stress"]
    drivers = [drive(packed["active_stress"]), drive(other)]
    for driver in drivers:
        driver.start(case.parameters, case.first())
    for (time, size), inputs, expected in zip(case.steps, case.inputs, case.expected[1:], strict=True):
        for driver, factor in zip(drivers, (1.0, 2.0), strict=True):
            assert driver.step(time, size, inputs) == 0
            np.testing.assert_array_equal(driver.get("active_stress"), factor * expected["active_stress"])


# --- instantiation ---------------------------------------------------------------------------------------------------


@pytest.fixture
def unpacked(make: Make, tmp_path: Path) -> Any:
    """A driver whose FMU lies in a folder the name of which has to be encoded in a URI."""
    driver = make("active_stress")
    driver.free()
    driver.messages.clear()
    folder = tmp_path / "an FMU, 100% ours"
    os.rename(driver.folder, folder)
    driver.folder = str(folder)
    return driver


def _locations(fmi: int, resources: Path) -> list[str]:
    if fmi == 3:
        # A path, which ends with a separator (FMI 3.0, section 2.3.1).
        return [f"{resources}/", str(resources)]
    plain = resources.as_uri().removeprefix("file://")
    return [f"file://{plain}", f"file:{plain}/", f"file://localhost{plain}", str(resources)]


def test_every_form_of_the_resources_location(unpacked: Any) -> None:
    for location in _locations(unpacked.fmi, Path(unpacked.folder) / "resources"):
        instance = unpacked.made("x", unpacked.description.guid, location=location)
        assert instance, (location, unpacked.messages)
        unpacked.component = ctypes.c_void_p(instance)
        unpacked.free()
    assert unpacked.messages == []


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"location": "/nowhere"}, "no file load.py in the resources of the FMU, /nowhere"),
        ({"name": ""}, "an instance needs a name"),
        ({"token": "{100%}"}, "{100%} is not that of this FMU"),
    ],
)
def test_what_is_wrong_with_an_instance_is_told(given: dict[str, Any], message: str, unpacked: Any) -> None:
    assert unpacked.made(**{"name": "x", "token": unpacked.description.guid} | given) is None
    ((status, _, text),) = unpacked.messages
    assert status == 3
    assert message in text


def test_what_only_fmi_2_gives_wrong(fmus: dict, drive: Make) -> None:
    driver = drive(fmus["active_stress"])
    for given, message in (
        ({"location": "https://somewhere/else"}, "https://somewhere/else"),
        ({"location": "file://nowhere"}, "no file: URI"),
        ({"kind": 0}, "for co-simulation only"),
    ):
        assert driver.made("x", driver.description.guid, **given) is None
        assert message in driver.errors()


def test_event_mode_is_refused(fmus3: dict, drive: Make) -> None:
    driver = drive(fmus3["active_stress"])
    assert driver.made("x", driver.description.guid, events=True) is None
    assert "hasEventMode" in driver.errors()


def test_damaged_resources_are_told(unpacked: Any) -> None:
    loader = Path(unpacked.folder) / "resources" / "load.py"
    for text, message in (("def instantiate(:", "invalid syntax"), ("1 / 0", "division by zero")):
        loader.write_text(text)
        assert unpacked.made("x", unpacked.description.guid) is None
        assert message in unpacked.errors()


def test_failures_are_told_to_hosts_that_asked_for_no_log_as_far_as_they_may_be(make: Make) -> None:
    driver = make("active_stress", logging=False)
    assert np.isnan(driver.read(driver.kinds[float], [10**6], 1)[0])
    if driver.fmi == 3:
        assert driver.messages == []
        return
    ((status, _, text),) = driver.messages
    assert (status, text) == (3, "unit 'active_stress' has no value reference 1000000")


# --- environments ----------------------------------------------------------------------------------------------------


def test_a_python_that_lacks_a_package_is_told_which(packed: dict, outside: Callable[..., str]) -> None:
    text = """
import sys
class Lacking:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "skfem":
            raise ModuleNotFoundError("No module named 'skfem'", name="skfem")
sys.meta_path.insert(0, Lacking())
try:
    drive(sys.argv[1])
except RuntimeError as error:
    print(error)
"""
    said = outside(text, packed["mechanics"])
    assert "this FMU needs the Python package 'skfem', which the Python " in said


def test_percent_signs_pass_the_logger_proxy_of_fmpy(fmus: dict, outside: Callable[..., str]) -> None:
    # In a process of its own: the proxy keeps one logger for all.
    text = """
import sys
from ctypes import byref
from fmpy.logging import addLoggerProxy
import fmi_driver

class Proxied(fmi_driver.Fmi2Driver):
    def instantiated(self, *given, **named):
        addLoggerProxy(byref(self.callbacks))
        return super().instantiated(*given, **named)
    def _log(self, environment, instance, status, category, message):
        print(message.decode())

driver = Proxied(sys.argv[1])
driver.parameterize({"delay_function": "100% %s %n %d %%"})
driver.close()
"""
    printed = outside(text, fmus["active_stress"])
    assert printed.startswith("parameter 'delay_function' is '100% %s %n %d %%'; choose one of: ")
