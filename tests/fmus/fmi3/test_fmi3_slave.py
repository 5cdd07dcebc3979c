"""If these fail, a unit gives other values as an FMI 3.0 FMU than by itself, loses its state, or crashes its host."""

import re
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus import build as fmi2_build
from cardiac_cosim.fmus.fmi3.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Drive = Callable[..., Any]

_OK, _DISCARD, _ERROR = 0, 2, 3


def _same(given: dict[str, list[float]], expected: dict[str, np.ndarray]) -> None:
    """Equal to the last bit."""
    assert set(given) == set(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(np.array(given[name]), values.ravel(), err_msg=name)


def _run(driver: Any, case: Any, first: int = 0) -> None:
    """The steps from number `first` on, each compared with the unit's own."""
    for number in range(first, len(case.steps)):
        assert driver.step(*case.steps[number], case.inputs[number]) == _OK
        _same(driver.outputs(), case.expected[number + 1])


# --- values --------------------------------------------------------------------------------------------------------


def test_bit_identical_to_the_unit(case: Any, fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3[case.unit])
    driver.start(case.parameters, case.first())
    _same(driver.outputs(), case.expected[0])
    _run(driver, case)
    assert driver.messages == []


def test_several_variables_in_one_call(cases: dict, fmus3: dict, drive3: Drive) -> None:
    case = cases["mechanics"]
    driver = drive3(fmus3["mechanics"])
    driver.parameterize(case.parameters)
    driver.fmu.enterInitializationMode()
    first = case.first()
    references = [driver.variables[name].valueReference for name in first]
    driver.fmu.setFloat64(references, np.concatenate([values.ravel() for values in first.values()]).tolist())
    assert driver.get(*first) == [value for values in first.values() for value in values.ravel().tolist()]
    driver.fmu.exitInitializationMode()
    names = ["displacement", "lv_volume", "time", "stretch"]
    expected = case.expected[0] | {"time": np.zeros(1)}
    assert driver.get(*names) == np.concatenate([expected[name].ravel() for name in names]).tolist()
    assert driver.errors() == ""


def test_time_is_where_the_last_step_ended(cases: dict, fmus3: dict, drive3: Drive) -> None:
    case = cases["active_stress"]
    driver = drive3(fmus3[case.unit])
    assert driver.get("time") == [0.0]
    driver.start(case.parameters, case.first())
    for number, (time, size) in enumerate(case.steps):
        state = driver.fmu.getFMUState()
        assert driver.step(time, size, case.inputs[number]) == _OK
        assert driver.get("time") == [time + size]
        driver.fmu.setFMUState(state)
        assert driver.get("time") == [time]
        driver.fmu.freeFMUState(state)
        assert driver.step(time, size, case.inputs[number]) == _OK


def test_inputs_and_parameters_read_back(case: Any, fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3[case.unit])
    for variable in UNITS[case.unit].variables():
        declared = driver.variables[variable.name]
        if declared.causality == "parameter":
            read = getattr(driver.fmu, f"get{declared.type}")([declared.valueReference])
            assert read == [variable.start]
        elif declared.causality == "input":
            assert set(driver.get(variable.name)) == {variable.start}
    driver.start(case.parameters, case.first())
    for name, value in case.parameters.items():
        declared = driver.variables[name]
        assert getattr(driver.fmu, f"get{declared.type}")([declared.valueReference]) == [value]
    for name, values in case.first().items():
        assert driver.get(name) == values.ravel().tolist()
    assert driver.errors() == ""


def test_outputs_before_the_initialization_are_nan_with_a_warning(fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3["active_stress"])
    assert np.isnan(driver.get("active_stress")).all()
    ((status, category, text),) = driver.messages
    assert (status, category) == (1, "logStatusWarning")
    assert "'active_stress' has no value before" in text


# --- several in one process ------------------------------------------------------------------------------------------


def test_all_units_in_one_process_two_of_each_and_of_fmi_2_as_well(
    fmus: dict, fmus3: dict, cases: dict, drive: Drive, drive3: Drive
) -> None:
    pairs = [(drive3(fmus3[name], f"{name} {k}"), cases[name]) for k in range(2) for name in UNITS]
    pairs += [(drive(fmus[name]), cases[name]) for name in UNITS]
    for driver, case in pairs:
        driver.start(case.parameters, case.first())
    for number in range(4):
        for driver, case in pairs:
            assert driver.step(*case.steps[number], case.inputs[number]) == _OK
        for driver, case in pairs:
            _same(driver.outputs(), case.expected[number + 1])


def test_two_versions_in_one_process_run_their_own_code(
    tiny: Mesh, fmus3: dict, cases: dict, drive3: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = fmi2_build.sources()
    changed = files["units/active_stress.py"].replace(b"_KPA_PER_MPA = 1000.0", b"_KPA_PER_MPA = 2000.0")
    assert changed != files["units/active_stress.py"]
    monkeypatch.setattr(fmi2_build, "sources", lambda: files | {"units/active_stress.py": changed})
    other = build_fmu(UNITS["active_stress"], tiny, tmp_path / "active_stress.fmu")
    case = cases["active_stress"]
    drivers = [drive3(fmus3["active_stress"]), drive3(other)]
    for driver in drivers:
        driver.start(case.parameters, case.first())
    for (time, size), inputs, expected in zip(case.steps, case.inputs, case.expected[1:], strict=True):
        for driver, factor in zip(drivers, (1.0, 2.0), strict=True):
            assert driver.step(time, size, inputs) == _OK
            np.testing.assert_array_equal(driver.get("active_stress"), factor * expected["active_stress"])


def test_it_runs_where_neither_this_project_nor_pythonfmu3_is(cases: dict, fmus3: dict, tmp_path: Path) -> None:
    case = cases["active_stress"]
    np.savez(tmp_path / "in.npz", *[inputs["potential"] for inputs in case.inputs])
    text = f"""
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("cardiac_cosim", "pythonfmu3"):
            raise ImportError("this process knows nothing of " + name)
sys.meta_path.insert(0, Blocker())
sys.path.insert(0, {str(Path(__file__).parent)!r})
import numpy as np
from fmi3_driver import Driver
driver = Driver(sys.argv[1])
with np.load(sys.argv[2]) as given:
    inputs = [given[name] for name in given.files]
driver.start({case.parameters!r}, {{"potential": inputs[0]}})
seen = [driver.get("active_stress")]
for (time, size), potential in zip({case.steps!r}, inputs, strict=True):
    assert driver.step(time, size, {{"potential": potential}}) == 0, driver.errors()
    seen.append(driver.get("active_stress"))
np.save(sys.argv[3], seen)
driver.close()
"""
    command = [sys.executable, "-c", text, str(fmus3[case.unit]), str(tmp_path / "in.npz"), str(tmp_path / "out.npy")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    # The other input is held at its start value, which is the default of the unit too.
    potentials = [inputs["potential"] for inputs in case.inputs]
    unit = UNITS[case.unit](case.mesh)
    unit.instantiate(case.parameters)
    unit.setup_experiment()
    unit.enter_initialization_mode()
    unit.set("potential", potentials[0])
    unit.exit_initialization_mode()
    expected = [unit.get("active_stress")]
    for step, potential in zip(case.steps, potentials, strict=True):
        unit.set("potential", potential)
        unit.do_step(*step)
        expected.append(unit.get("active_stress"))
    np.testing.assert_array_equal(np.load(tmp_path / "out.npy"), expected)


def test_a_python_without_a_package_is_told_its_name(fmus3: dict) -> None:
    text = f"""
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "skfem":
            raise ModuleNotFoundError("no such package", name="skfem")
sys.meta_path.insert(0, Blocker())
sys.path.insert(0, {str(Path(__file__).parent)!r})
from fmi3_driver import Driver
heard = []
Driver._log = lambda self, environment, status, category, message: heard.append(message.decode())
try:
    Driver(sys.argv[1])
except Exception as error:
    print(error)
print("; ".join(heard), flush=True)
"""
    command = [sys.executable, "-c", text, str(fmus3["mechanics"])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    # pythonfmu3's binary damages the memory on its way out of fmi3InstantiateCoSimulation: now and then the process is
    # aborted when it ends, after all that it had to say.
    assert done.returncode in (0, -signal.SIGABRT, -signal.SIGSEGV), done.stderr
    assert "Failed to instantiate FMU" in done.stdout
    assert "this FMU needs the Python package 'skfem'" in done.stdout


# --- life cycle ------------------------------------------------------------------------------------------------------


def test_reset_starts_anew(case: Any, fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3[case.unit])
    for _ in range(2):
        driver.start(case.parameters, case.first())
        _same(driver.outputs(), case.expected[0])
        _run(driver, case)
        driver.fmu.reset()
    assert driver.get("time") == [0.0]
    for name in case.parameters:
        declared = driver.variables[name]
        start = UNITS[case.unit].variable(name).start
        assert getattr(driver.fmu, f"get{declared.type}")([declared.valueReference]) == [start]
    assert driver.errors() == ""


def test_terminate_free_and_instantiate_again(case: Any, fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3[case.unit])
    for _ in range(2):
        driver.start(case.parameters, case.first())
        _run(driver, case)
        driver.fmu.terminate()
        _same(driver.outputs(), case.expected[-1])
        assert driver.errors() == ""
        assert driver.step(1.0, 1e-3) == _DISCARD
        assert "terminated" in driver.errors()
        driver.free()
        driver.instantiate()


# --- state -----------------------------------------------------------------------------------------------------------


def test_rollback_gives_the_same_bits(case: Any, fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3[case.unit])
    driver.start(case.parameters, case.first())
    states = []
    for number in range(4):
        states.append(driver.fmu.getFMUState())
        assert driver.step(*case.steps[number], case.inputs[number]) == _OK
    for number in (2, 0, 3, 1):
        driver.fmu.setFMUState(states[number])
        _same(driver.outputs(), case.expected[number])
        # The inputs are part of the state.
        for name, values in case.inputs[max(number - 1, 0)].items():
            assert driver.get(name) == values.ravel().tolist()
        _run(driver, case, first=number)
    for state in states:
        driver.fmu.freeFMUState(state)
    assert driver.errors() == ""


def test_a_serialized_state_goes_on_in_another_instance(case: Any, fmus3: dict, drive3: Drive) -> None:
    one, other = drive3(fmus3[case.unit]), drive3(fmus3[case.unit])
    one.start(case.parameters, case.first())
    assert one.step(*case.steps[0], case.inputs[0]) == _OK
    assert one.step(*case.steps[1], case.inputs[1]) == _OK
    stored = one.fmu.serializeFMUState(one.fmu.getFMUState())
    _run(one, case, first=2)
    other.start(case.parameters, case.first())
    other.fmu.setFMUState(other.fmu.deserializeFMUState(stored))
    assert other.get("time") == [sum(case.steps[1])]
    _same(other.outputs(), case.expected[2])
    _run(other, case, first=2)
    assert one.errors() == other.errors() == ""


@pytest.mark.parametrize("damage", [lambda data: b"", lambda data: data[:4], lambda data: data[:-100] + b"x" * 100])
def test_damaged_bytes_are_no_state(damage: Callable, cases: dict, fmus3: dict, drive3: Drive) -> None:
    case = cases["active_stress"]
    driver = drive3(fmus3[case.unit])
    driver.start(case.parameters, case.first())
    saved = driver.fmu.getFMUState()
    bad = driver.fmu.deserializeFMUState(damage(driver.fmu.serializeFMUState(saved)))
    driver.fmu.setFMUState(bad)
    assert "the state given to fmi3SetFMUState is none of this FMU" in driver.errors()
    assert np.isnan(driver.get("active_stress")).all()
    assert driver.step(*case.steps[0]) == _ERROR
    # A state that is one is the way back.
    driver.fmu.setFMUState(saved)
    driver.errors()
    _run(driver, case)


# --- errors ----------------------------------------------------------------------------------------------------------


def test_a_failing_step_is_discarded_and_changes_nothing(tiny: Mesh, fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3["active_stress"])
    driver.start({"delay_function": "seed"}, {})
    before = driver.outputs()
    for _ in range(2):
        assert driver.step(0.0, 1e-3, {"potential": np.full(tiny.nodes, 20.0)}) == _DISCARD
        ((status, category, text),) = driver.messages
        assert (status, category) == (_ERROR, "logStatusError")
        assert "use delay_function: gompertz" in text
        driver.messages.clear()
        assert driver.outputs() == before
        assert driver.get("time") == [0.0]
    # With what it can do it goes on.
    assert driver.step(0.0, 1e-3, {"potential": np.full(tiny.nodes, -80.0)}) == _OK
    assert driver.errors() == ""


_MISTAKES: dict[str, tuple[Callable[[Any], Any], str]] = {
    "too few values": (lambda d: d.set("potential", [1.0]), "got 1 values for 'potential', expected 16"),
    "too many": (lambda d: d.set("potential", [1.0] * 17), "got 17 values for 'potential', expected 16"),
    "not finite": (lambda d: d.set("potential", [np.nan] * 16), "'potential' .* is not finite at node"),
    "an output": (lambda d: d.set("active_stress", [1.0] * 16), "'active_stress' is an output"),
    "the time": (lambda d: d.set("time", [1.0]), "'time', is a Float64 that can be read only"),
    "no such reference": (lambda d: d.fmu.setFloat64([99], [1.0]), "has no value reference 99"),
    "reading none": (lambda d: d.fmu.getFloat64([99]), "has no value reference 99"),
    "another type": (lambda d: d.fmu.setInt32([d.variables["potential"].valueReference], [1]), "of type Float64, not"),
    "reading another": (lambda d: d.fmu.getString([d.variables["potential"].valueReference]), "of type Float64, not"),
    "64 bits": (lambda d: d.fmu.setInt64([d.variables["potential"].valueReference], [1]), "Float64, not Int64"),
    "unsigned": (lambda d: d.fmu.getUInt64([d.variables["potential"].valueReference]), "Float64, not UInt64"),
    "a truth value": (lambda d: d.fmu.getBoolean([d.variables["potential"].valueReference]), "Float64, not Boolean"),
    "call order": (lambda d: d.fmu.enterInitializationMode(), "this call needs it to be"),
}


@pytest.mark.parametrize("mistake", _MISTAKES)
def test_a_mistake_is_told_and_no_number_comes_of_it(mistake: str, cases: dict, fmus3: dict, drive3: Drive) -> None:
    call, words = _MISTAKES[mistake]
    case = cases["active_stress"]
    driver = drive3(fmus3[case.unit])
    driver.start(case.parameters, case.first())
    call(driver)
    ((status, category, text),) = driver.messages
    assert (status, category) == (_ERROR, "invalidInput")
    assert re.search(words, text), text
    driver.messages.clear()
    for values in driver.outputs().values():
        assert np.isnan(values).all()
    assert driver.step(*case.steps[0], {}) == _ERROR
    assert "refused because an earlier call failed" in driver.errors()
    driver.fmu.reset()
    driver.start(case.parameters, case.first())
    _run(driver, case)


def test_a_wrong_parameter_names_itself(fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3["active_stress"])
    driver.parameterize({"delay_function": "100%"})
    assert "'delay_function' is '100%'; choose one of: gom" in driver.errors()


def test_a_bug_is_told_with_its_traceback(fmus3: dict, drive3: Drive) -> None:
    driver = drive3(fmus3["active_stress"])
    driver.start({}, {})
    with zipfile.ZipFile(fmus3["active_stress"]) as archive:
        (package,) = {name.split("/")[1] for name in archive.namelist() if name.startswith("resources/cosim_")}
    unit = sys.modules[f"{package}.units.active_stress"].ActiveStress
    advance = unit.advance
    try:
        unit.advance = lambda *_: 1 / 0
        assert driver.step(0.0, 1e-3) == _DISCARD
    finally:
        unit.advance = advance
    text = driver.errors()
    assert text.startswith("ZeroDivisionError: division by zero")
    assert "in do_step" in text


def test_a_start_elsewhere_than_at_zero_is_refused(cases: dict, fmus3: dict, drive3: Drive) -> None:
    case = cases["electrophysiology"]
    driver = drive3(fmus3[case.unit])
    driver.start(case.parameters, case.first())
    assert driver.step(1.0, 1e-3, case.inputs[0]) == _ERROR
    assert "unit 'electrophysiology' starts at t = 0 s, not at 1.0 s" in driver.errors()
