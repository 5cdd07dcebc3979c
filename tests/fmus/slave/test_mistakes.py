"""If these fail, a mistake of the caller goes unnoticed, is not told in words, or spoils the run that goes on."""

import ctypes
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.registry import UNITS

Make = Callable[..., Any]
Mistake = Callable[[Any], Any]


def _told(driver: Any, words: str) -> None:
    """There is one message, an error of the caller, in these words."""
    ((status, category, text),) = driver.messages
    assert (status, category) == (3, "invalidInput")
    assert re.search(words, text), text
    assert "Traceback" not in text
    driver.messages.clear()


def _is_nothing(value: Any) -> bool:
    """Whether nobody would take it for a value of the unit's: a text is left as the host had it."""
    if isinstance(value, str):
        return value == "untouched"
    return value in (0, False) or value != value or value < -100


_ANY: dict[str, tuple[Mistake, str]] = {
    "no such reference": (lambda d: d.write(d.kinds[float], [10**6], [1.0]), "has no value reference 1000000"),
    "reading no such reference": (lambda d: d.read(d.kinds[float], [10**6]), "has no value reference 1000000"),
    "one wrong reference": (
        lambda d: d.write(d.kinds[float], [*d.references("potential"), 2**31 + 5], [0.0] * 17),
        "has no value reference 2147483653",
    ),
    "an output": (lambda d: d.set("active_stress", np.zeros(16)), "'active_stress' is an? output"),
    "not finite": (
        lambda d: d.set("potential", [*[0.0] * 3, np.nan, *[0.0] * 12]),
        r"'potential' .* finite at node \[3\]",
    ),
    "infinite": (lambda d: d.set("potential", np.full(16, np.inf)), r"'potential' .* not finite at node \[0\]"),
    "a late parameter": (lambda d: d.parameterize({"length_dependence": 0.1}), "'active_stress' is initialized"),
    "a late choice": (lambda d: d.parameterize({"delay_function": "as_printed"}), "'active_stress' is initialized"),
    "what it computes": (lambda d: d.write("String", d.references("implementation"), ["x"]), "'implementation' is"),
    "call order": (lambda d: d.enter(), "this call needs it to be"),
    "one right, one wrong": (
        lambda d: d.write(
            d.kinds[float],
            [*d.references("potential"), *d.references("active_stress")],
            [1.0] * 32,
        ),
        "'active_stress' is an? output",
    ),
}

_OF_FMI_2: dict[str, tuple[Mistake, str]] = {
    "an output's scalar": (
        lambda d: d.write("Real", [d.references("active_stress")[2]], [1.0]),
        "'active_stress' is an? output",
    ),
    "a scalar that is not finite": (
        lambda d: d.write("Real", [d.references("potential")[3]], [np.inf]),
        r"'potential' .* not finite at node \[3\]",
    ),
}

_OF_FMI_3: dict[str, tuple[Mistake, str]] = {
    "too few values": (lambda d: d.set("potential", [1.0]), "1 values were given or requested; 'potential' have 16"),
    "too many values": (
        lambda d: d.set("potential", [1.0] * 17),
        "17 values were given or requested; 'potential' have 16",
    ),
    "reading too many": (
        lambda d: d.read("Float64", d.references("potential"), 17),
        "17 values were given or requested; 'potential' have 16",
    ),
    "the time": (lambda d: d.set("time", [1.0]), "'time'"),
    "too many texts": (
        lambda d: d.write("String", d.references("delay_function"), ["gompertz", "as_printed"]),
        "2 texts were given for 1 variables",
    ),
}


def _after(driver: Any, case: Any, mistake: Mistake, words: str) -> None:
    """The mistake is told, changes nothing, and the run goes on to the same bits."""
    driver.start(case.parameters, case.first())
    assert driver.step(*case.steps[0], case.inputs[0]) == 0
    before = driver.packed()
    mistake(driver)
    assert [status for _, status in driver.refused] == [3]
    _told(driver, words)
    assert driver.packed() == before
    case.compare(driver.outputs(), 1)
    case.run(driver, first=1)
    assert driver.messages == []


@pytest.mark.parametrize("mistake", _ANY)
def test_mistakes_while_stepping(mistake: str, cases: dict, make: Make) -> None:
    _after(make("active_stress"), cases["active_stress"], *_ANY[mistake])


@pytest.mark.parametrize("mistake", _OF_FMI_2)
def test_mistakes_with_scalars_of_a_field(mistake: str, cases: dict, fmus: dict, drive: Make) -> None:
    _after(drive(fmus["active_stress"]), cases["active_stress"], *_OF_FMI_2[mistake])


@pytest.mark.parametrize("mistake", _OF_FMI_3)
def test_mistakes_with_arrays(mistake: str, cases: dict, fmus3: dict, drive: Make) -> None:
    _after(drive(fmus3["active_stress"]), cases["active_stress"], *_OF_FMI_3[mistake])


# --- types -----------------------------------------------------------------------------------------------------------

_NUMBERS: dict[int, tuple[str, ...]] = {
    2: ("Real", "Integer"),
    3: (
        "Float64",
        "Float32",
        *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)),
        "Boolean",
        "String",
    ),
}


def test_every_other_type_is_refused_by_name(make: Make) -> None:
    """Of a variable of each kind there is: a real field, a real, a whole number, and a choice."""
    driver = make("mechanics")
    for name in ("active_stress", "shear_modulus_MPa", "newton_iterations", "neo_hooke_log_sign"):
        own = driver.variables[name].type
        for kind in (*_NUMBERS[driver.fmi], "Boolean", "String"):
            if kind == own:
                continue
            words = f"'{name}' is of the type {own}, not {kind}"
            before = driver.packed()
            value = "x" if kind == "String" else True if kind == "Boolean" else 1
            assert driver.write(kind, driver.references(name), [value] * driver.size(name)) == 3
            _told(driver, words)
            for read in driver.read(kind, driver.references(name), driver.size(name)):
                assert _is_nothing(read), (kind, read)
            _told(driver, words)
            assert driver.packed() == before


def test_binaries_and_clocks_are_refused_by_name(fmus3: dict, drive: Make) -> None:
    driver = drive(fmus3["active_stress"])
    (reference,) = driver.references("slow_rate_per_ms")
    references, one = (ctypes.c_uint32 * 1)(reference), ctypes.c_size_t(1)
    sizes, binaries = (ctypes.c_size_t * 1)(3), (ctypes.c_char_p * 1)(b"abc")
    clocks = (ctypes.c_bool * 1)(True)
    for name, arguments in (
        ("SetBinary", (references, one, sizes, binaries, one)),
        ("GetBinary", (references, one, sizes, binaries, one)),
        ("SetClock", (references, one, clocks)),
        ("GetClock", (references, one, clocks)),
    ):
        assert driver.call(name, *arguments) == 3
        _told(driver, f"'slow_rate_per_ms' is of the type Float64, not {name[3:]}")
    assert driver.parameter("slow_rate_per_ms") == 0.1


def test_a_whole_number_that_cannot_be_read_is_no_plausible_one(make: Make) -> None:
    driver = make("mechanics")
    assert driver.parameter("newton_iterations") == 25
    kind = driver.kinds[int]
    assert driver.read(kind, driver.references("shear_modulus_MPa"))[0] < -(10**9)
    _told(driver, f"not {kind}")


# --- parameters and fixed inputs -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "parameter", "value", "words"),
    [
        ("active_stress", "delay_function", "gompert", "'gompert'; choose one of: gompertz, as_printed"),
        ("active_stress", "delay_function", "100%", "'delay_function' is '100%'; choose one of: gom"),
        ("active_stress", "slow_rate_per_ms", -0.1, "'slow_rate_per_ms' is -0.1; expected .* > 0"),
        ("active_stress", "slow_rate_per_ms", float("nan"), "'slow_rate_per_ms' is nan"),
        ("mechanics", "newton_iterations", 0, "'newton_iterations' is 0; expected a whole number >= 1"),
    ],
)
def test_a_parameter_out_of_range_keeps_its_value(
    unit: str, parameter: str, value: Any, words: str, make: Make
) -> None:
    driver = make(unit)
    before = driver.parameter(parameter)
    driver.parameterize({parameter: value})
    _told(driver, words)
    assert driver.parameter(parameter) == before
    driver.setup()
    assert driver.enter() == 0


@pytest.mark.parametrize(
    ("unit", "parameter", "value", "words"),
    [
        ("electrophysiology", "longest_substep_ms", 5.0, "'longest_substep_ms' is 5"),
        ("fiber_generator", "apex_z_mm", 0.0, "'apex_z_mm' is 0.0"),
    ],
)
def test_parameters_that_do_not_fit_the_rest_are_told_at_the_latest_when_the_initialization_ends(
    unit: str, parameter: str, value: Any, words: str, cases: dict, make: Make
) -> None:
    driver = make(unit)
    driver.start({parameter: value}, cases[unit].first())
    assert driver.refused
    _told(driver, words)
    # With another value the initialization ends: it is not over yet.
    if driver.refused == [("ExitInitializationMode", 3)]:
        driver.parameterize({parameter: UNITS[unit].variable(parameter).start})
        assert driver.leave() == 0
    assert driver.step(0.0, 1e-3) == 0


def test_a_fixed_input_cannot_be_changed_later(cases: dict, make: Make) -> None:
    case = cases["mechanics"]
    driver = make("mechanics")
    driver.start(case.parameters, case.first())
    # Many masters set every input before every step.
    assert driver.set("fiber", case.fixed["fiber"]) == 0
    assert driver.step(*case.steps[0], case.inputs[0]) == 0
    assert driver.set("fiber", np.roll(case.fixed["fiber"], 1, axis=1)) == 3
    _told(driver, "'fiber' of unit 'mechanics' is fixed after initialisation")
    if driver.fmi == 2:
        for reference, value in zip(driver.references("fiber"), case.fixed["fiber"].ravel(), strict=True):
            assert driver.write("Real", [reference], [value]) == 0
        assert driver.write("Real", driver.references("fiber")[:1], [0.5]) == 3
        _told(driver, "'fiber' of unit 'mechanics' is fixed after initialisation")
    assert driver.get("fiber") == case.fixed["fiber"].ravel().tolist()
    case.run(driver, first=1)


def test_of_a_call_that_is_refused_nothing_is_taken(cases: dict, make: Make) -> None:
    case = cases["mechanics"]
    driver = make("mechanics")
    driver.start(case.parameters, case.first())
    assert driver.step(*case.steps[0], case.inputs[0]) == 0
    before = driver.packed()
    names = ["active_stress", "fiber", "lv_pressure"]
    values = [np.zeros(driver.size("active_stress")), np.roll(case.fixed["fiber"], 1, axis=1).ravel(), [3.0]]
    references = [reference for name in names for reference in driver.references(name)]
    assert driver.write(driver.kinds[float], references, np.concatenate(values).tolist()) == 3
    _told(driver, "'fiber' of unit 'mechanics' is fixed after initialisation")
    assert driver.packed() == before
    # Neither of parameters of which one is wrong.
    driver.reset()
    before = driver.packed()
    names = ["shear_modulus_MPa", "fiber_exponent", "lv_pressure"]
    references = [reference for name in names for reference in driver.references(name)]
    assert driver.write(driver.kinds[float], references, [0.5, -1.0, 2.0]) == 3
    _told(driver, "'fiber_exponent' is -1.0")
    assert driver.packed() == before
