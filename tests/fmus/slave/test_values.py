"""If these fail, a unit gives other values as an FMU than by itself."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Make = Callable[..., Any]


def test_expected_values_move(stepping: Any) -> None:
    # Otherwise all comparisons below would hold for a unit that does nothing.
    # No wave moves on in these few steps, and where fibres lie in the fixed base they are the longest all the time.
    still = {"activation_time", "activation_time_mean", "activation_time_max"}
    still |= {"stretch_max"} if stepping.unit == "mechanics" else set()
    for name in set(stepping.expected[0]) - still:
        assert (stepping.expected[1][name] != stepping.expected[4][name]).any(), name


def test_bit_identical_to_the_unit(case: Any, make: Make) -> None:
    driver = make(case.unit)
    driver.start(case.parameters, case.first())
    case.compare(driver.outputs(), 0)
    case.run(driver)
    assert driver.messages == []
    assert driver.refused == []


def test_scalar_by_scalar_in_any_order(case: Any, fmus: dict, drive: Make) -> None:
    """In FMI 2.0 only, where a field is scalars."""
    driver = drive(fmus[case.unit])
    shuffle = np.random.default_rng(3)

    def set_shuffled(fields: dict[str, np.ndarray]) -> None:
        pairs = [
            pair
            for name, values in fields.items()
            for pair in zip(driver.references(name), values.ravel(), strict=True)
        ]
        shuffle.shuffle(pairs)
        # Some one by one, the rest in chunks across the fields.
        for reference, value in pairs[:5]:
            assert driver.write("Real", [reference], [value]) == 0
        for chunk in np.array_split(np.array(pairs[5:], dtype=object).reshape(-1, 2), 3):
            assert driver.write("Real", chunk[:, 0].tolist(), chunk[:, 1].tolist()) == 0

    def get_shuffled() -> dict[str, list[float]]:
        wanted = [vr for name in case.expected[0] for vr in driver.references(name)]
        order = [wanted[k] for k in shuffle.permutation(len(wanted))]
        values = dict(zip(order, driver.read("Real", order), strict=True))
        for vr in wanted[:5]:
            assert driver.read("Real", [vr]) == [values[vr]]
        return {name: [values[vr] for vr in driver.references(name)] for name in case.expected[0]}

    driver.parameterize(case.parameters)
    driver.setup()
    driver.enter()
    set_shuffled(case.first())
    driver.leave()
    case.compare(get_shuffled(), 0)
    for number, (step, inputs) in enumerate(zip(case.steps, case.inputs, strict=True), start=1):
        set_shuffled(inputs)
        assert driver.step(*step) == 0
        case.compare(get_shuffled(), number)
    assert driver.messages == []


def test_several_variables_in_one_call(cases: dict, make: Make) -> None:
    case = cases["mechanics"]
    driver = make("mechanics")
    driver.parameterize(case.parameters)
    driver.setup()
    driver.enter()
    first = case.first()
    references = [reference for name in first for reference in driver.references(name)]
    values = np.concatenate([values.ravel() for values in first.values()]).tolist()
    assert driver.write(driver.kinds[float], references, values) == 0
    assert driver.get(*first) == values
    driver.leave()
    names = ["displacement", "lv_volume", "stretch"]
    assert driver.get(*names) == np.concatenate([case.expected[0][name].ravel() for name in names]).tolist()
    assert driver.messages == []


def test_inputs_and_parameters_read_back(case: Any, make: Make) -> None:
    driver = make(case.unit)
    unit = UNITS[case.unit](case.mesh)
    for name in driver.names("parameter"):
        assert driver.parameter(name) == unit.get(name)
    for name in driver.names("input"):
        assert driver.get(name) == unit.get(name).ravel().tolist()
    driver.start(case.parameters, case.first())
    for name, value in case.parameters.items():
        assert driver.parameter(name) == value
    for name, values in case.first().items():
        assert driver.get(name) == values.ravel().tolist()
    assert driver.messages == []


def test_a_value_read_before_is_not_read_again(make: Make) -> None:
    driver = make("active_stress")
    names = ["slow_rate_per_ms", "fast_rate_per_ms"]
    assert driver.get(*names) == [0.1, 1.0]
    driver.parameterize({"slow_rate_per_ms": 0.2, "fast_rate_per_ms": 2.0})
    assert driver.get(*names) == [0.2, 2.0]
    count = driver.size("potential")
    assert driver.get("potential") == [-80.0] * count
    driver.set("potential", np.arange(count))
    assert driver.get("potential") == list(range(count))


def test_a_scalar_of_a_field_leaves_the_others_as_they_are(fmus: dict, drive: Make) -> None:
    driver = drive(fmus["active_stress"])
    first, *_, last = driver.references("potential")
    assert driver.read("Real", [first, last]) == [-80.0, -80.0]
    driver.write("Real", [last], [3.0])
    assert driver.read("Real", [first, last]) == [-80.0, 3.0]
    driver.write("Real", [first], [4.0])
    assert driver.get("potential") == [4.0, *[-80.0] * (driver.size("potential") - 2), 3.0]


def test_time_is_where_the_last_step_ended(cases: dict, make: Make) -> None:
    case = cases["active_stress"]
    driver = make(case.unit)
    driver.start(case.parameters, case.first())
    assert driver.reached() == 0.0
    for number, (time, size) in enumerate(case.steps):
        state = driver.save()
        assert driver.step(time, size, case.inputs[number]) == 0
        assert driver.reached() == time + size
        driver.restore(state)
        assert driver.reached() == time
        driver.release(state)
        assert driver.step(time, size, case.inputs[number]) == 0
    driver.reset()
    if driver.fmi == 3:
        # What fmi3DoStep tells besides.
        assert driver.stepped == (sum(case.steps[-1]), False, False, False)
        assert driver.get("time") == [0.0]
    assert driver.messages == []


def test_outputs_before_the_initialization(case: Any, make: Make) -> None:
    driver = make(case.unit)
    for values in driver.outputs().values():
        assert np.isnan(values).all()
    assert {(status, category) for status, category, _ in driver.messages} == {(1, "logStatusWarning")}
    assert "has no value before the initialization" in driver.messages[0][2]
    # It was a question, not a failure.
    driver.messages.clear()
    driver.setup()
    driver.enter()
    # Now outputs have values, though no direction is known yet, and follow whatever is set: parameters as well.
    assert all(np.isfinite(values).all() for values in driver.outputs().values())
    for name, values in case.first().items():
        driver.set(name, values)
    driver.parameterize(case.parameters)
    case.compare(driver.outputs(), 0)
    assert driver.leave() == 0
    case.compare(driver.outputs(), 0)
    assert driver.messages == []
    assert driver.refused == []


def test_no_references_are_no_values(make: Make) -> None:
    driver = make("active_stress")
    driver.start({}, {})
    for kind in driver.kinds.values():
        assert driver.write(kind, [], []) == 0
        assert driver.read(kind, []) == []
    assert driver.messages == []


@pytest.mark.parametrize("cells", [1, 2])
def test_outputs_after_one_another_are_read_as_at_once(cells: int, fmi: int, tmp_path: Any, drive: Make) -> None:
    # A mesh of another size in the same process: neither takes the other's places.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    mesh = Mesh(points[: 3 + cells], np.array([[0, 1, 2, 3], [1, 2, 3, 4]])[:cells])
    driver = drive(build_fmu(UNITS["active_stress"], mesh, tmp_path / "small.fmu", fmi))
    driver.start({}, {"potential": np.full(mesh.nodes, 20.0)})
    assert driver.step(0.0, 1e-3) == 0
    names = driver.names("output")
    assert driver.get(*names) == [value for name in names for value in driver.get(name)]
    assert driver.size("active_stress") == mesh.nodes
