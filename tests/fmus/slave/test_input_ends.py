"""If these fail, inputs that run over a step reach a unit otherwise than by a direct call, or stay too long.

By derivatives in FMI 2.0 (section 4.2.1), by an intermediate update in FMI 3.0 (section 4.2.2): the same bits.
"""

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Make = Callable[..., Any]

_RUNNING = [name for name, unit in UNITS.items() if unit.interpolates]
_HELD = [name for name, unit in UNITS.items() if not unit.interpolates and unit.inputs()]


class _Ends:
    """What inputs are at the end of the next step, by whichever means the version has."""

    def __init__(self) -> None:
        self.values: Mapping[str, Any] = {}
        self.statuses: list[int] = []

    def __call__(self, driver: Any, _time: float) -> None:
        """The intermediate update of FMI 3.0."""
        self.statuses += [driver.set(name, values) for name, values in self.values.items()]

    def step(self, driver: Any, time: float, size: float, begins: Mapping[str, Any]) -> int:
        """A step over which inputs run from `begins` to the `values`."""
        for name, values in begins.items():
            assert driver.set(name, values) == 0
            if driver.fmi == 2 and name in self.values:
                self.statuses.append(driver.set_derivatives(name, (np.asarray(self.values[name]) - values) / size))
        return int(driver.advance(time, size))


def _reached(begin: Any, end: Any, size: float, fmi: int) -> Any:
    """The end as FMI 2.0 reaches it: from the begin, by the slope."""
    return begin + size * ((end - begin) / size) if fmi == 2 else end


@pytest.fixture
def ends() -> _Ends:
    return _Ends()


@pytest.fixture
def running(make: Make, fmi: int, ends: _Ends) -> Make:
    """Instantiate a unit whose inputs run to `ends`."""
    return lambda unit: make(unit, **({"update": ends} if fmi == 3 else {}))


@pytest.mark.parametrize("unit", _RUNNING)
def test_the_same_bits_as_the_unit_with_ends(unit: str, cases: dict, running: Make, ends: _Ends) -> None:
    case = cases[unit]
    driver = running(unit)
    driver.start(case.parameters, case.first())
    own = UNITS[unit](case.mesh)
    own.instantiate(case.parameters)
    own.setup_experiment()
    own.enter_initialization_mode()
    for name, values in case.first().items():
        own.set(name, values)
    own.exit_initialization_mode()
    moved = False
    for number, (time, size) in enumerate(case.steps):
        begins, last = case.inputs[number], case.inputs[(number + 1) % 4]
        # Every other step holds its inputs.
        ends.values = last if number % 2 == 0 else {}
        exact = {name: _reached(begins[name], values, size, driver.fmi) for name, values in ends.values.items()}
        for name, values in begins.items():
            own.set(name, values)
        own.do_step(time, size, exact)
        assert ends.step(driver, time, size, begins) == 0, driver.errors()
        for name, values in driver.outputs().items():
            np.testing.assert_array_equal(values, np.ravel(own.get(name)), err_msg=name)
        # After the step the inputs are what was set, whatever they ran to.
        for name, values in begins.items():
            assert driver.get(name) == np.ravel(values).tolist()
        moved |= any(
            not np.array_equal(own.get(name), case.expected[number + 1][name]) for name in driver.names("output")
        )
    assert moved
    assert set(ends.statuses) == {0}
    assert driver.messages == []


def _mass(running: Make) -> Any:
    driver = running("mass")
    driver.start({"k": 5.0, "c": 0.5, "x_start": 1.0}, {})
    return driver


def test_they_hold_for_one_completed_step(running: Make, ends: _Ends) -> None:
    driver, held = _mass(running), _mass(running)
    ends.values = {"F_in": [3.0]}
    assert ends.step(driver, 0.0, 0.1, {"F_in": [1.0]}) == 0
    ends.values = {}
    assert held.step(0.0, 0.1, {"F_in": [1.0]}) == 0
    assert driver.get("x") != held.get("x")
    # From one state on, the next step is one with a held input.
    assert held.restore(held.unpack(driver.packed())) == 0
    for one in (driver, held):
        assert one.step(0.1, 0.1) == 0
    assert driver.packed() == held.packed()


def test_a_step_that_was_refused_leaves_them_for_the_next(fmus: dict, drive: Make) -> None:
    driver, other = drive(fmus["mass"]), drive(fmus["mass"])
    for one in (driver, other):
        one.start({"k": 5.0}, {})
        assert one.set_derivatives("F_in", [2.0]) == 0
    assert driver.step(0.0, 0.0) == 3
    assert driver.step(1.0, 0.1) == 3
    for one in (driver, other):
        assert one.step(0.0, 0.1) == 0
    assert driver.packed() == other.packed()
    assert driver.get("x") != [0.0]


def test_a_discarded_step_leaves_them_for_another_try(running: Make, ends: _Ends, tiny: Mesh) -> None:
    driver, other = running("active_stress"), running("active_stress")
    for one in (driver, other):
        one.start({"delay_function": "as_printed"}, {"potential": np.full(tiny.nodes, -79.0)})
    ends.values = {"potential": np.full(tiny.nodes, 80.0)}
    assert ends.step(driver, 0.0, 1e-3, {"potential": np.full(tiny.nodes, -79.0)}) == 2
    assert driver.reached() == 0.0
    driver.messages.clear()
    ends.values = {"potential": np.full(tiny.nodes, -78.0)}
    for one in (driver, other):
        assert ends.step(one, 0.0, 1e-3, {"potential": np.full(tiny.nodes, -79.0)}) == 0, driver.errors()
    assert driver.packed() == other.packed()


def test_derivatives_are_part_of_the_state(fmus: dict, drive: Make) -> None:
    driver, other = drive(fmus["mass"]), drive(fmus["mass"])
    driver.start({"k": 5.0}, {"F_in": [1.0]})
    assert driver.set_derivatives("F_in", [2.0]) == 0
    stored = driver.packed()
    assert driver.set_derivatives("F_in", [-7.0]) == 0
    assert other.restore(other.unpack(stored)) == 0
    assert driver.restore(driver.unpack(stored)) == 0
    third = drive(fmus["mass"])
    third.start({"k": 5.0}, {"F_in": [1.0]})
    assert third.set_derivatives("F_in", [2.0]) == 0
    for one in (driver, other, third):
        assert one.step(0.0, 0.25) == 0
    assert driver.get("x", "v") == other.get("x", "v") == third.get("x", "v")
    # In an instance without any they go with the state that has none.
    driver.reset()
    driver.start({"k": 5.0}, {"F_in": [1.0]})
    none = driver.save()
    assert driver.set_derivatives("F_in", [2.0]) == 0
    driver.restore(none)
    held = drive(fmus["mass"])
    held.start({"k": 5.0}, {"F_in": [1.0]})
    for one in (driver, held):
        assert one.step(0.0, 0.25) == 0
    assert driver.get("x") == held.get("x") != third.get("x")


def test_derivatives_of_single_scalars(cases: dict, fmus: dict, drive: Make) -> None:
    case = cases["active_stress"]
    driver, whole = drive(fmus["active_stress"]), drive(fmus["active_stress"])
    slopes = np.zeros(16)
    slopes[[2, 11]] = [4000.0, -3000.0]
    for one in (driver, whole):
        one.start(case.parameters, case.first())
    for place in (11, 2):
        (reference,), one = driver.references("potential")[place : place + 1], ctypes.c_size_t(1)
        arrays = (ctypes.c_uint32 * 1)(reference), one, (ctypes.c_int32 * 1)(1), (ctypes.c_double * 1)(slopes[place])
        assert driver.call("SetRealInputDerivatives", *arrays) == 0
    assert whole.set_derivatives("potential", slopes) == 0
    for one in (driver, whole):
        assert one.step(0.0, 1e-3) == 0
    assert driver.packed() == whole.packed()


def test_derivatives_that_there_are_not(fmus: dict, drive: Make) -> None:
    driver = drive(fmus["mass"])
    driver.start({}, {})
    before = driver.packed()
    for status, words in (
        (
            driver.set_derivatives("F_in", [1.0], order=2),
            "takes the first time derivatives of its inputs, not those of",
        ),
        (
            driver.set_derivatives("F_in", [1.0], order=0),
            "takes the first time derivatives of its inputs, not those of",
        ),
        (driver.set_derivatives("F_in", [float("nan")]), "the time derivative of 'F_in' is not finite"),
        (driver.set_derivatives("x", [1.0]), "'x' is"),
        (driver.set_derivatives("m", [1.0]), "unit 'mass' is initialized"),
    ):
        assert status == 3
        assert words in driver.messages.pop(0)[2]
    assert driver.packed() == before


@pytest.mark.parametrize("unit", _HELD)
def test_units_that_hold_their_inputs_say_so(unit: str, cases: dict, running: Make, ends: _Ends) -> None:
    case = cases[unit]
    driver = running(unit)
    driver.start(case.parameters, case.first())
    name = driver.names("input")[0]
    assert not driver.description.coSimulation.canInterpolateInputs
    if driver.fmi == 2:
        assert driver.set_derivatives(name, np.zeros(driver.size(name))) == 3
        assert f"unit '{unit}' keeps its inputs over a step (canInterpolateInputs is false)" in driver.errors()
    case.run(driver)
    # None has asked.
    assert driver.fmi == 2 or driver.updates == []


# --- the intermediate update -----------------------------------------------------------------------------------------


def test_an_update_is_asked_for_once_at_the_end_of_the_step(fmus3: dict, drive: Make) -> None:
    driver = drive(fmus3["mass"], update=lambda driver, time: None)
    driver.start({"x_start": 1.0}, {})
    other = drive(fmus3["mass"])
    other.start({"x_start": 1.0}, {})
    for one in (driver, other):
        assert one.step(0.0, 0.1) == 0
        assert one.step(0.1, 0.25) == 0
    # Inputs may be set, outputs not be read; it is no finished step of the solver's, and cannot end the step.
    assert driver.updates == [(0.1, True, False, False, False), (0.35, True, False, False, False)]
    # Nothing was set: held.
    assert driver.packed() == other.packed()


def test_no_update_for_a_step_that_there_is_not(fmus3: dict, drive: Make) -> None:
    driver = drive(fmus3["mass"], update=lambda driver, time: None)
    driver.start({}, {})
    assert driver.step(0.0, 0.0) == 3
    assert driver.step(1.0, 0.1) == 3
    assert driver.updates == []


def _times(time: float, size: float) -> list[Any]:
    """Arguments of a step of which nothing is to be known."""
    return [ctypes.c_double(time), ctypes.c_double(size), ctypes.c_bool(True), None, None, None, None]


_INSIDE: dict[str, Callable[[Any], Any]] = {
    "a step": lambda driver: driver.call("DoStep", *_times(0.0, 0.1)),
    "reading": lambda driver: driver.get("x"),
    "a choice": lambda driver: driver.write("Int32", driver.references("k"), [7]),
    "a state": lambda driver: driver.save(),
    "reset": lambda driver: driver.reset(),
    "terminate": lambda driver: driver.terminate(),
}


@pytest.mark.parametrize("call", _INSIDE)
def test_what_is_refused_inside_of_an_update(call: str, fmus3: dict, drive: Make) -> None:
    def update(driver: Any, _time: float) -> None:
        statuses.append(driver.set("F_in", [3.0]))
        _INSIDE[call](driver)

    statuses: list[int] = []
    driver = drive(fmus3["mass"], update=update)
    driver.start({"k": 5.0, "x_start": 1.0}, {})
    assert driver.step(0.0, 0.1) == 0
    assert statuses == [0]
    # It told why, and the step went on.
    assert [status for status, _, _ in driver.messages] == [3]
    sound = drive(fmus3["mass"], update=lambda driver, _time: driver.set("F_in", [3.0]))
    sound.start({"k": 5.0, "x_start": 1.0}, {})
    assert sound.step(0.0, 0.1) == 0
    assert driver.packed() == sound.packed()


_WRONG: dict[str, Callable[[Any], Any]] = {
    "a parameter": lambda driver: driver.parameterize({"k": 7.0}),
    "an output": lambda driver: driver.set("x", [1.0]),
    "not finite": lambda driver: driver.set("F_in", [float("nan")]),
    "too many": lambda driver: driver.set("F_in", [1.0, 2.0]),
    "no such reference": lambda driver: driver.write("Float64", [999], [1.0]),
}


@pytest.mark.parametrize("value", _WRONG)
def test_no_step_is_taken_with_values_that_were_refused(value: str, fmus3: dict, drive: Make) -> None:
    def update(driver: Any, _time: float) -> None:
        if wrong:
            assert driver.set("F_in", [3.0]) == 0
            _WRONG[value](driver)
            assert driver.refused

    wrong = True
    driver, sound = drive(fmus3["mass"], update=update), drive(fmus3["mass"])
    for one in (driver, sound):
        one.start({"k": 5.0, "x_start": 1.0}, {})
    before = driver.packed()
    assert driver.step(0.0, 0.1) == 3
    assert driver.errors()
    assert driver.packed() == before
    # Nothing of it is left for the step that is taken then.
    wrong = False
    for one in (driver, sound):
        assert one.step(0.0, 0.1) == 0
    assert driver.packed() == sound.packed()
