"""If these fail, a unit gives other values as an FMU than by itself, loses its state, or takes its host down."""

import gc
import re
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus import build
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Drive = Callable[..., Any]

_ALL = list(UNITS)
_STEPPING = ["electrophysiology", "active_stress", "mechanics"]


@pytest.fixture(params=_ALL)
def case(request: pytest.FixtureRequest, cases: dict) -> Any:
    return cases[request.param]


@pytest.fixture(params=_STEPPING)
def stepping(request: pytest.FixtureRequest, cases: dict) -> Any:
    """The units that change in a step."""
    return cases[request.param]


def _same(given: dict[str, list[float]], expected: dict[str, np.ndarray]) -> None:
    """Equal to the last bit."""
    assert set(given) == set(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(np.array(given[name]), values.ravel(), err_msg=name)


def _run(driver: Any, case: Any, first: int = 0) -> None:
    """The steps from number `first` on, each compared with the unit's own."""
    for number in range(first, len(case.steps)):
        assert driver.step(*case.steps[number], case.inputs[number]) == 0
        _same(driver.outputs(), case.expected[number + 1])


def _nothing_but_nan(driver: Any) -> None:
    for values in driver.outputs().values():
        assert np.isnan(values).all()


# --- values --------------------------------------------------------------------------------------------------------


def test_expected_values_move(stepping: Any) -> None:
    # Otherwise all comparisons below would hold for a unit that does nothing.
    # No wave moves on in these few steps, and where fibres lie in the fixed base they are the longest all the time.
    still = {"activation_time", "activation_time_mean", "activation_time_max"}
    still |= {"stretch_max"} if stepping.unit == "mechanics" else set()
    for name in set(stepping.expected[0]) - still:
        assert (stepping.expected[1][name] != stepping.expected[4][name]).any(), name


def test_bit_identical_to_the_unit(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    driver.start(case.parameters, case.first())
    _same(driver.outputs(), case.expected[0])
    _run(driver, case)
    assert driver.messages == []


def test_scalar_by_scalar_in_any_order(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    shuffle = np.random.default_rng(3)

    def set_shuffled(fields: dict[str, np.ndarray]) -> None:
        pairs = [
            pair for name, values in fields.items() for pair in zip(driver.fields[name], values.ravel(), strict=True)
        ]
        shuffle.shuffle(pairs)
        # Some one by one, the rest in chunks across the fields.
        for pair in pairs[:5]:
            driver.fmu.setReal([int(pair[0])], [pair[1]])
        for chunk in np.array_split(np.array(pairs[5:], dtype=object).reshape(-1, 2), 3):
            driver.fmu.setReal([int(vr) for vr in chunk[:, 0]], [float(value) for value in chunk[:, 1]])

    def get_shuffled() -> dict[str, list[float]]:
        wanted = [vr for name in case.expected[0] for vr in driver.fields[name]]
        order = shuffle.permutation(len(wanted))
        values = dict(zip([wanted[k] for k in order], driver.fmu.getReal([wanted[k] for k in order]), strict=True))
        for vr in wanted[:5]:
            assert driver.fmu.getReal([vr]) == [values[vr]]
        return {name: [values[vr] for vr in driver.fields[name]] for name in case.expected[0]}

    driver.parameterize(case.parameters)
    driver.fmu.setupExperiment()
    driver.fmu.enterInitializationMode()
    set_shuffled(case.first())
    driver.fmu.exitInitializationMode()
    _same(get_shuffled(), case.expected[0])
    for step, inputs, expected in zip(case.steps, case.inputs, case.expected[1:], strict=True):
        set_shuffled(inputs)
        assert driver.step(*step) == 0
        _same(get_shuffled(), expected)
    assert driver.errors() == ""


def test_inputs_and_parameters_read_back(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    for variable in driver.description.modelVariables:
        if variable.causality in ("input", "parameter"):
            (value,) = getattr(driver.fmu, f"get{variable.type}")([variable.valueReference])
            read = value.decode() if isinstance(value, bytes) else value
            assert read == {"Real": float, "Integer": int, "String": str}[variable.type](variable.start)
    driver.start(case.parameters, case.first())
    for name, value in case.parameters.items():
        variable = driver.variables[name]
        (read,) = getattr(driver.fmu, f"get{variable.type}")([variable.valueReference])
        assert (read.decode() if isinstance(read, bytes) else read) == value
    for name, values in case.first().items():
        assert driver.get(name) == values.ravel().tolist()
    assert driver.errors() == ""


def test_a_value_read_before_is_not_read_again(fmus: dict, drive: Drive) -> None:
    driver = drive(fmus["active_stress"])
    names = ["slow_rate_per_ms", "fast_rate_per_ms"]
    references = [driver.variables[name].valueReference for name in names]
    assert driver.fmu.getReal(references) == [0.1, 1.0]
    driver.fmu.setReal(references, [0.2, 2.0])
    assert driver.fmu.getReal(references) == [0.2, 2.0]
    first, *_, last = driver.fields["potential"]
    assert driver.fmu.getReal([first, last]) == [-80.0, -80.0]
    driver.fmu.setReal([last], [3.0])
    assert driver.fmu.getReal([first, last]) == [-80.0, 3.0]
    driver.fmu.setReal([first], [4.0])
    assert driver.get("potential") == [4.0, *[-80.0] * (len(driver.fields["potential"]) - 2), 3.0]


# --- alone in the world ----------------------------------------------------------------------------------------------


def test_it_runs_where_this_project_is_not(case: Any, fmus: dict, outside: Callable[..., str], tmp_path: Path) -> None:
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
driver = Driver(sys.argv[1])
varying = lambda n: {key.split("/")[1]: value for key, value in given.items() if key.startswith(f"{n}/")}
driver.start(parameters, {key: value for key, value in given.items() if "/" not in key} | varying(0))
seen = {f"0/{name}": values for name, values in driver.outputs().items()}
for n, (time, size) in enumerate(steps):
    assert driver.step(time, size, varying(n)) == 0, driver.errors()
    seen |= {f"{n + 1}/{name}": values for name, values in driver.outputs().items()}
assert not driver.errors()
assert not [name for name in sys.modules if name.startswith("cardiac_cosim")]
np.savez(sys.argv[3], **seen)
driver.close()
"""
    outside(text, fmus[case.unit], tmp_path / "in.npz", tmp_path / "out.npz", case.parameters, case.steps)
    with np.load(tmp_path / "out.npz") as seen:
        for number, expected in enumerate(case.expected):
            _same({name: seen[f"{number}/{name}"] for name in expected}, expected)


def test_all_units_in_one_process_and_two_of_each(fmus: dict, cases: dict, drive: Drive) -> None:
    pairs = [(drive(fmus[name], f"{name} {k}"), cases[name]) for k in range(2) for name in _ALL]
    for driver, case in pairs:
        driver.start(case.parameters, case.first())
    for number in range(4):
        for driver, case in pairs:
            assert driver.step(*case.steps[number], case.inputs[number]) == 0
        for driver, case in pairs:
            _same(driver.outputs(), case.expected[number + 1])


def test_instances_of_one_fmu_share_nothing(stepping: Any, fmus: dict, drive: Drive) -> None:
    one, other = drive(fmus[stepping.unit], "one"), drive(fmus[stepping.unit], "other")
    one.start(stepping.parameters, stepping.first())
    other.start({}, stepping.first())
    assert one.step(*stepping.steps[0], stepping.inputs[0]) == 0
    assert other.step(0.0, 5e-3, stepping.inputs[3]) == 0
    _same(one.outputs(), stepping.expected[1])
    assert other.outputs() != one.outputs()
    _run(one, stepping, first=1)


# --- life cycle ------------------------------------------------------------------------------------------------------


def test_reset_starts_anew(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    for _ in range(2):
        driver.start(case.parameters, case.first())
        _same(driver.outputs(), case.expected[0])
        _run(driver, case)
        driver.fmu.reset()
    # Back to the declared start values, too.
    for name in case.parameters:
        variable = driver.variables[name]
        (read,) = getattr(driver.fmu, f"get{variable.type}")([variable.valueReference])
        assert str(read.decode() if isinstance(read, bytes) else read) == variable.start
    assert driver.errors() == ""


def test_terminate_free_and_instantiate_again(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    for _ in range(2):
        driver.start(case.parameters, case.first())
        _run(driver, case)
        driver.fmu.terminate()
        _same(driver.outputs(), case.expected[-1])
        assert driver.errors() == ""
        assert driver.step(1.0, 1e-3) == 2
        assert "terminated" in driver.errors()
        driver.free()
        driver.instantiate()


# --- state -----------------------------------------------------------------------------------------------------------


def test_rollback_gives_the_same_bits(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    driver.start(case.parameters, case.first())
    states = []
    for number in range(4):
        states.append(driver.fmu.getFMUstate())
        assert driver.step(*case.steps[number], case.inputs[number]) == 0
    for number in (2, 0, 3, 1):
        driver.fmu.setFMUstate(states[number])
        _same(driver.outputs(), case.expected[number])
        # The inputs are part of the state.
        for name, values in case.inputs[max(number - 1, 0)].items():
            assert driver.get(name) == values.ravel().tolist()
        _run(driver, case, first=number)
    for state in states:
        driver.fmu.freeFMUstate(state)
    assert driver.errors() == ""


def test_rollback_forgets_what_was_set_scalar_by_scalar(stepping: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[stepping.unit])
    driver.start(stepping.parameters, stepping.first())
    assert driver.step(*stepping.steps[0], stepping.inputs[0]) == 0
    state = driver.fmu.getFMUstate()
    for name in stepping.inputs[0]:
        driver.fmu.setReal(driver.fields[name][-1:], [0.9])
    driver.fmu.setFMUstate(state)
    for name, values in stepping.inputs[0].items():
        assert driver.get(name) == values.ravel().tolist()
    _run(driver, stepping, first=1)


def test_a_state_holds_what_was_set_scalar_by_scalar(stepping: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[stepping.unit])
    driver.start(stepping.parameters, stepping.first())
    name = next(iter(stepping.inputs[0]))
    driver.fmu.setReal(driver.fields[name][1:2], [0.9])
    state = driver.fmu.getFMUstate()
    driver.set(name, stepping.inputs[1][name])
    driver.fmu.setFMUstate(state)
    assert driver.get(name)[1] == 0.9


def test_a_serialized_state_goes_on_in_another_instance(case: Any, fmus: dict, drive: Drive) -> None:
    one, other = drive(fmus[case.unit]), drive(fmus[case.unit])
    one.start(case.parameters, case.first())
    assert one.step(*case.steps[0], case.inputs[0]) == 0
    assert one.step(*case.steps[1], case.inputs[1]) == 0
    stored = one.fmu.serializeFMUstate(one.fmu.getFMUstate())
    _run(one, case, first=2)
    other.start(case.parameters, case.first())
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(stored))
    _same(other.outputs(), case.expected[2])
    _run(other, case, first=2)
    assert one.errors() == other.errors() == ""


def test_a_serialized_state_goes_on_in_another_process(
    stepping: Any, fmus: dict, drive: Drive, outside: Callable[..., str], tmp_path: Path
) -> None:
    driver = drive(fmus[stepping.unit])
    driver.start(stepping.parameters, stepping.first())
    for number in range(3):
        assert driver.step(*stepping.steps[number], stepping.inputs[number]) == 0
    (tmp_path / "state").write_bytes(driver.fmu.serializeFMUstate(driver.fmu.getFMUstate()))
    np.savez(tmp_path / "fixed.npz", **stepping.first())
    np.savez(tmp_path / "inputs.npz", **stepping.inputs[3])
    text = """
import ast, sys
from pathlib import Path
import numpy as np
folder = Path(sys.argv[2])
driver = Driver(sys.argv[1])
driver.start(ast.literal_eval(sys.argv[3]), dict(np.load(folder / "fixed.npz")))
driver.fmu.setFMUstate(driver.fmu.deSerializeFMUstate((folder / "state").read_bytes()))
assert driver.step(*ast.literal_eval(sys.argv[4]), dict(np.load(folder / "inputs.npz"))) == 0, driver.errors()
np.savez(folder / "out.npz", **driver.outputs())
driver.close()
"""
    outside(text, fmus[stepping.unit], tmp_path, stepping.parameters, stepping.steps[3])
    with np.load(tmp_path / "out.npz") as seen:
        _same(dict(seen), stepping.expected[4])


def test_saving_states_needs_no_memory(fmus: dict, cases: dict, drive: Drive) -> None:
    case = cases["active_stress"]
    driver = drive(fmus[case.unit])
    driver.start(case.parameters, case.first())

    def grown(cycles: int, free: bool) -> int:
        """Bytes that `cycles` of saving, stepping and going back leave in memory."""
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(cycles):
            state = driver.fmu.getFMUstate()
            copy = driver.fmu.deSerializeFMUstate(driver.fmu.serializeFMUstate(state))
            assert driver.step(0.0, 1e-4, case.inputs[0]) == 0
            driver.fmu.setFMUstate(copy)
            if free:
                driver.fmu.freeFMUstate(state)
                driver.fmu.freeFMUstate(copy)
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - before

    grown(20, free=True)
    tracemalloc.start()
    try:
        grown(20, free=True)
        # 42 doubles in 4 arrays; what is really kept shows in the second number.
        assert grown(500, free=True) < 100_000
        assert grown(150, free=False) > 150_000
    finally:
        tracemalloc.stop()
    assert driver.errors() == ""


@pytest.mark.parametrize("garbage", ["nothing", "text", "cut", "flipped", "other unit", "other mesh", "objects"])
def test_a_damaged_state_is_refused(
    garbage: str, fmus: dict, cases: dict, small_heart: Mesh, drive: Drive, tmp_path: Path
) -> None:
    case = cases["active_stress"]
    driver = drive(fmus[case.unit])
    driver.start(case.parameters, case.first())
    good = driver.fmu.getFMUstate()
    stored = driver.fmu.serializeFMUstate(good)
    if garbage in ("other unit", "other mesh"):
        unit = "mechanics" if garbage == "other unit" else "active_stress"
        other_fmu = fmus[unit] if garbage == "other unit" else build_fmu(UNITS[unit], small_heart, tmp_path / "x.fmu")
        other = drive(other_fmu)
        other.start({}, cases[unit].first() if garbage == "other unit" else {})
        bad = other.fmu.serializeFMUstate(other.fmu.getFMUstate())
    else:
        np.savez(tmp_path / "x.npz", format=1, unit="active_stress", **{"input/potential": np.array(["a", "b"])})
        bad = {
            "nothing": b"",
            "text": b"this is no state",
            "cut": stored[: len(stored) // 2],
            "flipped": stored[:300] + bytes([stored[300] ^ 255]) + stored[301:],
            "objects": (tmp_path / "x.npz").read_bytes(),
        }[garbage]
    driver.fmu.setFMUstate(driver.fmu.deSerializeFMUstate(bad))
    refused = driver.errors()
    assert "state" in refused
    assert "Traceback" not in refused
    assert driver.step(*case.steps[0], case.inputs[0]) == driver.given_up
    assert "refused" in driver.errors()
    _nothing_but_nan(driver)
    # A sound state is the way back.
    driver.fmu.setFMUstate(good)
    _run(driver, case)


# --- errors ----------------------------------------------------------------------------------------------------------


def test_a_failing_step_is_discarded_and_changes_nothing(fmus: dict, drive: Drive, tiny: Mesh) -> None:
    driver = drive(fmus["active_stress"])
    driver.start({"delay_function": "seed"}, {})
    assert driver.step(0.0, 1e-3, {"potential": np.full(tiny.nodes, -79.0)}) == 0
    before = driver.outputs()
    depolarised = np.full(tiny.nodes, -79.0)
    depolarised[4] = 20.0
    assert driver.step(1e-3, 1e-3, {"potential": depolarised}) == 2
    (message,) = [m for m in driver.messages if m[0] >= 3]
    assert "at node 4 (potential 20.0 mV)" in message[2]
    assert "delay_function: gompertz" in message[2]
    assert message[1] != "invalidInput"
    driver.messages.clear()
    assert driver.outputs() == before
    # The unit is as it was: with a potential it can follow it goes on as if nothing had been tried.
    assert driver.step(1e-3, 1e-3, {"potential": np.full(tiny.nodes, -78.0)}) == 0
    other = drive(fmus["active_stress"])
    other.start({"delay_function": "seed"}, {})
    assert other.step(0.0, 1e-3, {"potential": np.full(tiny.nodes, -79.0)}) == 0
    assert other.step(1e-3, 1e-3, {"potential": np.full(tiny.nodes, -78.0)}) == 0
    assert driver.outputs() == other.outputs() != before


def _wrong_reference(driver: Any) -> None:
    driver.fmu.getReal([10**6])


def _wrong_reference_among_right_ones(driver: Any) -> None:
    driver.fmu.setReal([*driver.fields["potential"], 2**31 + 5], [0.0] * (len(driver.fields["potential"]) + 1))


def _set_output(driver: Any) -> None:
    driver.set("active_stress", np.zeros(len(driver.fields["active_stress"])))


def _set_one_of_output(driver: Any) -> None:
    driver.fmu.setReal([driver.fields["active_stress"][2]], [1.0])


def _nan_field(driver: Any) -> None:
    driver.set("potential", np.full(len(driver.fields["potential"]), np.nan))


def _nan_scalar(driver: Any) -> None:
    driver.fmu.setReal([driver.fields["potential"][3]], [np.inf])


def _late_parameter(driver: Any) -> None:
    driver.parameterize({"length_dependence": 0.1})


def _type(call: str, name: str, value: Any = None) -> Callable[[Any], None]:
    def do(driver: Any) -> None:
        arguments = ([driver.variables[name].valueReference], *([] if value is None else [[value]]))
        getattr(driver.fmu, call)(*arguments)

    do.__name__ = f"{call} of {name}"
    return do


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (_wrong_reference, "no value reference 1000000"),
        (_wrong_reference_among_right_ones, "no value reference"),
        (_set_output, "'active_stress' is an output"),
        (_set_one_of_output, "'active_stress' is an output"),
        (_nan_field, r"'potential' .* not finite at node \[0\]"),
        (_nan_scalar, r"'potential' .* not finite at node \[3\]"),
        (_late_parameter, "active_stress.* is initialized"),
        (_type("getReal", "delay_function"), "'delay_function', is of type String, not Real"),
        (_type("getInteger", "length_dependence"), "'length_dependence', is of type Real, not Integer"),
        (_type("getString", "length_dependence"), "'length_dependence', is of type Real, not String"),
        (_type("getString", "potential[1]"), "'potential', is of type Real, not String"),
        (_type("getBoolean", "length_dependence"), "'length_dependence', is of type Real, not Boolean"),
        (_type("setInteger", "length_dependence", 1), "'length_dependence', is of type Real, not Integer"),
        (_type("setBoolean", "length_dependence", True), "'length_dependence', is of type Real, not Boolean"),
        (_type("setString", "potential[1]", "0"), "'potential', is of type Real, not String"),
        (_type("setReal", "delay_function", 0.0), "'delay_function', is of type String, not Real"),
    ],
    ids=lambda value: value.__name__.strip("_") if callable(value) else "",
)
def test_mistakes_while_stepping(
    mistake: Callable[[Any], None], message: str, fmus: dict, cases: dict, drive: Drive
) -> None:
    case = cases["active_stress"]
    driver = drive(fmus["active_stress"])
    driver.start(case.parameters, case.first())
    state = driver.fmu.getFMUstate()
    mistake(driver)
    # What is wrong with single values shows at the latest when the unit needs them.
    for _ in range(2):
        assert driver.step(*case.steps[0]) == driver.given_up
        _nothing_but_nan(driver)
    said = [m for m in driver.messages if m[0] >= 3]
    assert said[0][1] == "invalidInput"
    assert re.search(message, said[0][2]), said[0][2]
    assert not any("Traceback" in text for _, _, text in said)
    driver.errors()
    driver.fmu.setFMUstate(state)
    _run(driver, case)
    assert driver.errors() == ""


def test_an_integer_that_cannot_be_read_is_no_plausible_one(fmus: dict, drive: Drive) -> None:
    driver = drive(fmus["mechanics"])
    reference = driver.variables["newton_iterations"].valueReference
    assert driver.fmu.getInteger([reference]) == [25]
    assert driver.fmu.getInteger([reference + 1])[0] < -(10**9)
    assert "not Integer" in driver.errors()


def test_a_fixed_input_cannot_be_changed_later(fmus: dict, cases: dict, drive: Drive) -> None:
    case = cases["mechanics"]
    for change in (
        lambda d: d.set("fiber", np.roll(case.fixed["fiber"], 1, axis=1)),
        lambda d: d.fmu.setReal(d.fields["fiber"][:1], [0.5]),
    ):
        driver = drive(fmus["mechanics"])
        driver.start(case.parameters, case.first())
        # Many masters set every input before every step.
        driver.set("fiber", case.fixed["fiber"])
        for reference, value in zip(driver.fields["fiber"], case.fixed["fiber"].ravel(), strict=True):
            driver.fmu.setReal([reference], [value])
        assert driver.step(*case.steps[0], case.inputs[0]) == 0
        change(driver)
        assert driver.step(*case.steps[0]) == driver.given_up
        assert "'fiber' of unit 'mechanics' is fixed after initialisation" in driver.errors()
        assert driver.step(*case.steps[0]) == driver.given_up


@pytest.mark.parametrize(
    ("unit", "parameter", "value", "message"),
    [
        ("active_stress", "delay_function", "gompert", "'gompert'; choose one of: gompertz, seed"),
        ("active_stress", "slow_rate_per_ms", -0.1, "'slow_rate_per_ms' is -0.1; expected .* > 0"),
        ("active_stress", "slow_rate_per_ms", float("nan"), "'slow_rate_per_ms' is nan"),
        ("mechanics", "newton_iterations", 0, "'newton_iterations' is 0; expected a whole number >= 1"),
        ("electrophysiology", "longest_substep_ms", 5.0, "'longest_substep_ms' is 5"),
        ("fiber_generator", "apex_z_mm", 0.0, "'apex_z_mm' is 0.0"),
    ],
)
def test_wrong_parameters(
    unit: str, parameter: str, value: Any, message: str, fmus: dict, cases: dict, drive: Drive
) -> None:
    driver = drive(fmus[unit])
    driver.start({parameter: value}, cases[unit].first())
    first = driver.messages[0]
    assert (first[0], first[1]) == (3, "invalidInput")
    assert re.search(message, first[2]), first[2]
    assert driver.step(0.0, 1e-3) == driver.given_up
    _nothing_but_nan(driver)


def test_outputs_before_the_initialisation(case: Any, fmus: dict, drive: Drive) -> None:
    driver = drive(fmus[case.unit])
    _nothing_but_nan(driver)
    driver.fmu.setupExperiment()
    driver.fmu.enterInitializationMode()
    assert {status for status, _, _ in driver.messages} == {1}
    assert "no value before the initialization" in driver.messages[0][2]
    # It was a question, not a failure.
    driver.messages.clear()
    # Now outputs have values, though no direction is known yet, and follow whatever is set: parameters as well.
    assert all(np.isfinite(values).all() for values in driver.outputs().values())
    for name, values in case.first().items():
        driver.set(name, values)
    driver.parameterize(case.parameters)
    _same(driver.outputs(), case.expected[0])
    assert driver.messages == []
    driver.fmu.exitInitializationMode()
    assert driver.errors() == ""
    assert not any(np.isnan(values).any() for values in driver.outputs().values())


def test_steps_and_states_out_of_order(fmus: dict, cases: dict, drive: Drive) -> None:
    driver = drive(fmus["active_stress"])
    assert driver.step(0.0, 1e-3) == 2
    assert "needs it to be initialized" in driver.errors()
    driver.fmu.exitInitializationMode()
    assert "in initialization mode" in driver.errors()
    driver.fmu.reset()
    driver.start({}, {})
    for time, size in ((0.0, -1e-3), (0.0, float("nan")), (float("inf"), 1e-3)):
        assert driver.step(time, size) == 2
        assert "both finite, the step >= 0" in driver.errors()
    case = cases["active_stress"]
    assert driver.step(*case.steps[0], case.inputs[0]) == 0
    driver.fmu.reset()
    driver.fmu.setupExperiment(startTime=0.5)
    assert "starts at t = 0 s, not at 0.5 s" in driver.errors()


@pytest.mark.parametrize(("unit", "boundary"), [("mechanics", "base"), ("fiber_generator", "epicardium")])
def test_a_mesh_without_a_boundary(
    unit: str, boundary: str, tiny: Mesh, cases: dict, drive: Drive, tmp_path: Path
) -> None:
    mesh = Mesh(tiny.points, tiny.cells, {name: faces for name, faces in tiny.boundaries.items() if name != boundary})
    driver = drive(build_fmu(UNITS[unit], mesh, tmp_path / "x.fmu"))
    driver.start({}, cases[unit].first())
    ((status, category, text),) = driver.messages
    assert (status, category) == (3, "invalidInput")
    assert f"no boundary named '{boundary}'" in text
    assert driver.step(0.0, 1e-3) == driver.given_up
    _nothing_but_nan(driver)


def test_a_bug_in_a_unit_is_told_with_its_traceback(
    tiny: Mesh, drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = build.sources()
    broken = files["units/active_stress.py"].replace(b"        rate = self._tension.rate(potential)", b"        1 / 0")
    assert broken != files["units/active_stress.py"]
    monkeypatch.setattr(build, "sources", lambda: files | {"units/active_stress.py": broken})
    driver = drive(build_fmu(UNITS["active_stress"], tiny, tmp_path / "x.fmu"))
    driver.start({}, {})
    assert driver.step(0.0, 1e-3) == 2
    ((status, category, text),) = driver.messages
    assert (status, category) == (3, "logStatusError")
    # First the reason, because hosts cut long messages.
    assert text.startswith("ZeroDivisionError: division by zero\n")
    assert "active_stress.py" in text
    assert "Traceback" in text


def test_percent_signs_pass_the_logger_proxy_of_fmpy(fmus: dict, outside: Callable[..., str]) -> None:
    # In a process of its own: the proxy keeps one logger for all.
    text = """
import sys
from ctypes import byref
from fmpy.logging import addLoggerProxy
import fmi_driver

class Proxied(Driver):
    def instantiate(self):
        addLoggerProxy(byref(self._callbacks))
        super().instantiate()
    def _log(self, environment, instance, status, category, message):
        print(message.decode())

driver = Proxied(sys.argv[1])
driver.parameterize({"delay_function": "100% %s %n %d %%"})
driver.close()
"""
    printed = outside(text, fmus["active_stress"])
    assert printed.startswith("parameter 'delay_function' is '100% %s %n %d %%'; choose one of: ")
