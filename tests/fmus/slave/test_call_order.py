"""If these fail, an FMU takes or refuses other calls than the standard says, or is not the same after a refused one.

The tables are those of FMI 2.0.4, section 4.2.4, and FMI 3.0.2, sections 2.3 and 4.2, with a column for each state:

    `x` allowed by the standard and by us; `-` refused by both
    `+` allowed by us only, for hosts that know no better; what it does is said beside it
    `w` allowed by us, with a warning: there is no value yet, and it reads as NaN

A call that is refused is an error with its reason, after which everything is as before: the run goes on to the same
bits. By the standard an instance that returned an error has to be reset or set to a state; ours need not be.
"""

import ctypes
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

Make = Callable[..., Any]
Call = Callable[[Any], int]

_STATES = ("instantiated", "initialization", "stepped", "discarded", "terminated")

_BOTH = """
    set a debug log          x x x x x
    enter initialization     x - - - -
    exit initialization      - x - - -
    terminate                - - x x -
    reset                    x x x x x
    get an output            w x x x x
    set a parameter          x x - - -
    set a choice             x x - - -
    set an output            - - - - -
    derivatives              - x x x x     of outputs by inputs; discarded: of the last step that was completed
    get a state              x x x x x
    set a state              x x x x x
    serialize a state        x x x x x
    free a state             x x x x x
"""

_TABLES = {
    2: _BOTH
    + """
    set up the experiment    x - - - -
    step                     - - x + -     discarded: it may be tried again, with other inputs or another size
    set an input             + x x + -     instantiated: as in FMI 3.0; discarded: as step
    get an input             + + x x x     what it starts with, or was set to, as in FMI 3.0
    get a parameter          + + x x x
    get a choice             + + x x x
    get what it computes     + x x x x     before the initialization is over: an empty text
    set input derivatives    x x x + -     discarded: as step
    input derivatives of 2   - - - - -
    output derivatives       - - - - -     maxOutputDerivativeOrder is 0
    cancel a step            - - - - -     no step is pending when fmi2DoStep has returned
    last successful time     + + x x x
    has it terminated        + + x x x
    types platform           x x x x x
    version                  x x x x x
""",
    3: _BOTH
    + """
    step                     - - x x -     discarded: the instance is as before the step, and may go on
    set an input             x x x x -
    get an input             x x x x x
    get a parameter          x x x x x
    get a choice             x x x x x
    get what it computes     + x x x x     before the initialization is over: an empty text
    adjoint derivatives      - x x x x
    get the time             + x x x x     instantiated: 0
    set the time             - - - - -
    enter event mode         - - - - -     hasEventMode is false
    enter step mode          - - - - -
    discrete states          - - - - -
    enter configuration      - - - - -     there are no structural parameters
    exit configuration       - - - - -
    output derivatives       - - - - -     maxOutputDerivativeOrder is 0
    variable dependencies    - - - - -     providesPerElementDependencies is false
    a clock's interval       - - - - -
    a model partition        - - - - -
    version                  x x x x x
""",
}

_REFERENCE = (ctypes.c_uint32 * 1)(1)
_ONE = ctypes.c_size_t(1)
_NUMBER = (ctypes.c_double * 1)(0.0)
_ORDER = (ctypes.c_int32 * 1)(1)


def _state(driver: Any, use: Callable[[Any], int]) -> int:
    """The worse of saving a state and using it."""
    state = driver.save()
    status = driver.refused[-1][1] if driver.refused else 0
    if state:
        status = max(status, use(state))
        driver.release(state)
    return status


def _read(kind: str, name: str) -> Call:
    def call(driver: Any) -> int:
        messages = len(driver.messages)
        driver.read(kind or driver.kinds[float], driver.references(name), driver.size(name))
        return max((status for status, _, _ in driver.messages[messages:]), default=0)

    return call


def _write(kind: type, name: str, value: Any) -> Call:
    return lambda driver: driver.write(driver.kinds[kind], driver.references(name), [value] * driver.size(name))


def _derivative(driver: Any, name: str) -> int:
    refused = len(driver.refused)
    driver.derivative(name, driver.references("active_stress"), driver.references("potential"), [1.0] * 16, 16)
    return int(driver.refused[-1][1]) if len(driver.refused) > refused else 0


def _step(driver: Any) -> int:
    return int(driver.advance(driver.reached(), 1e-3))


def _serialized(driver: Any) -> int:
    return _state(driver, lambda state: driver.restore(driver.unpack(driver.pack(state))))


_CALLS: dict[str, Call] = {
    "set a debug log": lambda driver: driver.call("SetDebugLogging", ctypes.c_int(1), ctypes.c_size_t(0), None),
    "set up the experiment": lambda driver: driver.setup(),
    "enter initialization": lambda driver: driver.enter(),
    "exit initialization": lambda driver: driver.leave(),
    "step": _step,
    "terminate": lambda driver: driver.terminate(),
    "reset": lambda driver: driver.reset(),
    "get an output": _read("", "active_stress"),
    "get an input": _read("", "potential"),
    "get a parameter": _read("", "slow_rate_per_ms"),
    "get a choice": _read("String", "delay_function"),
    "get what it computes": _read("String", "implementation"),
    "set an input": _write(float, "potential", -70.0),
    "set a parameter": _write(float, "slow_rate_per_ms", 0.2),
    "set a choice": _write(str, "delay_function", "gompertz"),
    "set an output": _write(float, "active_stress", 1.0),
    "derivatives": lambda driver: _derivative(driver, "GetDirectionalDerivative"),
    "adjoint derivatives": lambda driver: _derivative(driver, "GetAdjointDerivative"),
    "get a state": lambda driver: _state(driver, lambda state: 0),
    "set a state": lambda driver: _state(driver, driver.restore),
    "serialize a state": _serialized,
    "free a state": lambda driver: _state(driver, driver.release),
    "set input derivatives": lambda driver: driver.set_derivatives("potential", [1.0] * 16),
    "input derivatives of 2": lambda driver: driver.set_derivatives("potential", [1.0] * 16, order=2),
    "cancel a step": lambda driver: driver.call("CancelStep"),
    "last successful time": lambda driver: driver.call("GetRealStatus", 2, ctypes.byref(ctypes.c_double())),
    "has it terminated": lambda driver: driver.call("GetBooleanStatus", 3, ctypes.byref(ctypes.c_int())),
    "types platform": lambda driver: _text(driver, "GetTypesPlatform", b"default"),
    "version": lambda driver: _text(driver, "GetVersion", {2: b"2.0", 3: b"3.0"}[driver.fmi]),
    "get the time": _read("Float64", "time"),
    "set the time": _write(float, "time", 1.0),
    "enter event mode": lambda driver: driver.call("EnterEventMode"),
    "enter step mode": lambda driver: driver.call("EnterStepMode"),
    "discrete states": lambda driver: driver.call(
        "UpdateDiscreteStates", *(ctypes.byref(ctypes.c_bool()) for _ in range(5)), ctypes.byref(ctypes.c_double())
    ),
    "enter configuration": lambda driver: driver.call("EnterConfigurationMode"),
    "exit configuration": lambda driver: driver.call("ExitConfigurationMode"),
    "output derivatives": lambda driver: driver.call(
        {2: "GetRealOutputDerivatives", 3: "GetOutputDerivatives"}[driver.fmi],
        _REFERENCE, _ONE, _ORDER, _NUMBER, *[_ONE] * (driver.fmi - 2),
    ),
    "variable dependencies": lambda driver: driver.call(
        "GetNumberOfVariableDependencies", ctypes.c_uint32(1), ctypes.byref(ctypes.c_size_t())
    ),
    "a clock's interval": lambda driver: driver.call("GetIntervalDecimal", _REFERENCE, _ONE, _NUMBER, _ORDER),
    "a model partition": lambda driver: driver.call(
        "ActivateModelPartition", ctypes.c_uint32(1), ctypes.c_double(0.0)
    ),
}  # fmt: skip


def _text(driver: Any, name: str, expected: bytes) -> int:
    function = driver.function(name)
    function.restype = ctypes.c_char_p
    return 0 if function() == expected else -1


def _table(fmi: int) -> dict[str, str]:
    """Of every call, its marks."""
    rows = [line.strip() for line in _TABLES[fmi].splitlines() if line.strip()]
    return {row[:24].strip(): row[24:].split("  ")[0].replace(" ", "")[: len(_STATES)] for row in rows}


#: Depolarised cells make the delay function as the source has it negative, which ends the step.
_TOO_MUCH, _SOUND = [20.0] * 16, [-79.0] * 16


def _bring(driver: Any, state: str) -> None:
    """To one of the states."""
    driver.parameterize({"delay_function": "as_printed"})
    if state == "instantiated":
        return
    driver.setup(0.0, 1.0)
    driver.enter()
    driver.set("potential", _SOUND)
    if state == "initialization":
        return
    driver.leave()
    assert driver.step(0.0, 1e-3) == 0
    if state == "discarded":
        assert driver.step(1e-3, 1e-3, {"potential": _TOO_MUCH}) == 2
        driver.set("potential", _SOUND)
    if state == "terminated":
        driver.terminate()


def _finish(driver: Any, state: str) -> list[float]:
    """What can be seen of the instance when it goes on from there to the end."""
    if state == "instantiated":
        driver.setup(0.0, 1.0)
        driver.enter()
        driver.set("potential", _SOUND)
    if state in ("instantiated", "initialization"):
        assert driver.leave() == 0
    if state != "terminated":
        for _ in range(3):
            assert driver.step(driver.reached(), 1e-3, {"potential": [-79.5] * 16}) == 0, driver.errors()
        assert driver.terminate() == 0
    return [*driver.get(*driver.names("output")), driver.reached()]


def test_the_tables_are_complete(fmi: int) -> None:
    table = _table(fmi)
    assert set(table) <= set(_CALLS)
    assert all(len(marks) == len(_STATES) for marks in table.values()), table
    assert set(_CALLS) == set(_table(2)) | set(_table(3))


@pytest.mark.parametrize("state", _STATES)
def test_calls_in_every_state(state: str, fmi: int, make: Make) -> None:
    driver, undisturbed = make("active_stress"), make("active_stress", "undisturbed")
    for one in (driver, undisturbed):
        _bring(one, state)
    here = driver.save()
    stored = driver.pack(here)
    for name, marks in _table(fmi).items():
        mark = marks[_STATES.index(state)]
        driver.messages.clear()
        driver.refused.clear()
        status = _CALLS[name](driver)
        what = f"{name} when {state}: {status}, {driver.messages}"
        assert status == {"x": 0, "+": 0, "w": 1, "-": 3}[mark], what
        if mark == "-":
            # The reason, and no change.
            assert [told for told, _, _ in driver.messages] == [3], what
            assert driver.messages[0][2], what
            assert driver.packed() == stored, what
        else:
            assert not [text for told, _, text in driver.messages if told > 1], what
            assert driver.restore(here) == 0, what
            assert driver.packed() == stored, what
    assert _finish(driver, state) == _finish(undisturbed, state)


@pytest.mark.parametrize("state", _STATES)
def test_all_that_is_refused_one_after_the_other(state: str, fmi: int, make: Make) -> None:
    """Without going back to a state in between: nothing is left of any of it."""
    driver, undisturbed = make("active_stress"), make("active_stress", "undisturbed")
    for one in (driver, undisturbed):
        _bring(one, state)
    refused = [name for name, marks in _table(fmi).items() if marks[_STATES.index(state)] == "-"]
    assert refused
    for name in refused:
        assert _CALLS[name](driver) == 3
    assert _finish(driver, state) == _finish(undisturbed, state)
    assert driver.packed() == undisturbed.packed()


# --- what the tables leave open --------------------------------------------------------------------------------------


def test_an_experiment_that_was_not_set_up_starts_at_zero_and_has_no_end(fmus: dict, drive: Make) -> None:
    driver = drive(fmus["mass"])
    assert driver.enter() == 0
    assert driver.leave() == 0
    assert driver.step(0.0, 1e6) == 0


def test_the_experiment_can_be_set_up_again_before_it_begins(make: Make) -> None:
    driver = make("mass")
    for stop in (1.0, 2.0, math.inf, 3.0):
        assert driver.setup(0.0, stop) == 0
    driver.enter()
    driver.leave()
    assert driver.step(0.0, 2.5) == 0
    assert driver.step(2.5, 1.0) == 3


def test_inputs_and_outputs_in_turns_until_the_initialization_ends(make: Make, cases: dict) -> None:
    """Loops over the initial values of outputs are solved so."""
    driver = make("mechanics")
    driver.setup()
    driver.enter()
    for name, values in cases["mechanics"].first().items():
        driver.set(name, values)
    volumes = []
    for pressure in (0.0, 1.0, 0.0):
        assert driver.set("lv_pressure", [pressure]) == 0
        volumes.append(driver.get("lv_volume")[0])
    assert volumes[0] == volumes[2] < volumes[1]
    assert driver.leave() == 0
    assert driver.get("lv_volume")[0] == volumes[0]


def test_an_input_that_is_set_does_not_move_outputs_before_the_step(cases: dict, make: Make) -> None:
    """The standard forbids to look (section 4.2.4); who looks sees what the last step has computed."""
    case = cases["mechanics"]
    driver = make("mechanics")
    driver.start(case.parameters, case.first())
    assert driver.step(*case.steps[0], case.inputs[0]) == 0
    for name, values in case.inputs[1].items():
        driver.set(name, values)
    case.compare(driver.outputs(), 1)
    case.run(driver, first=1)


def test_what_a_step_that_failed_leaves_to_be_asked(make: Make) -> None:
    driver = make("active_stress")
    _bring(driver, "discarded")
    assert driver.reached() == 1e-3
    if driver.fmi == 3:
        assert driver.stepped == (1e-3, False, False, False)
    else:
        terminated = ctypes.c_int(1)
        assert driver.call("GetBooleanStatus", 3, ctypes.byref(terminated)) == 0
        assert terminated.value == 0
    assert np.isfinite(driver.get("active_stress")).all()
