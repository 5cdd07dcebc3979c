"""If these fail, a unit whose inputs run to other ends follows something else than what was exchanged."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress, Tension
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.test_problems import Mass
from cardiac_cosim.units.variable import Causality
from scipy.integrate import solve_ivp

_GENTLE = {"delay_slope_per_mV": 0.05}


@pytest.fixture(scope="module")
def cube(box: Any) -> Any:
    return box([0.0, 1.0, 3.0], [0.0, 1.0], [-1.0, 0.0])


@pytest.fixture(scope="module")
def bar(box: Any) -> Any:
    return box(np.linspace(0.0, 20.0, 21), [0.0, 1.0], [-1.0, 0.0])


# --- active stress ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step_ms", [1e-3, 1.0, 5.0, 1e3])
def test_a_ramped_potential_gives_the_mean_over_the_moments_of_its_change(step_ms: float, cube: Any, started) -> None:
    first, last = np.full(cube.nodes, -70.0), np.linspace(-80.0, 20.0, cube.nodes)
    unit = started(ActiveStress, cube, potential=first)
    unit.do_step(0.0, 1e-3 * step_ms, {"potential": last})
    law, moments = Tension(), (np.polynomial.legendre.leggauss(400)[0] + 1.0) / 2.0
    weights = np.polynomial.legendre.leggauss(400)[1] / 2.0
    before, after = law.rate(first) * step_ms, law.rate(last) * step_ms
    expected = np.zeros(cube.nodes)
    for moment, weight in zip(moments, weights, strict=True):
        reached = law.target(first) * -np.expm1(-before * moment)
        expected += weight * (law.target(last) + (reached - law.target(last)) * np.exp(-after * (1.0 - moment)))
    np.testing.assert_allclose(unit.get("active_stress"), 1e3 * expected, rtol=1e-7 if step_ms < 100.0 else 1e-3)


def test_ramped_inputs_make_active_stress_second_order(cube: Any, started: Any) -> None:
    def potential(time: float) -> np.ndarray:
        return np.linspace(-80.0, -60.0, cube.nodes) + 80.0 * np.sin(0.1 * time) ** 2

    law = Tension(**_GENTLE)
    exact = solve_ivp(
        lambda time, tension: law.rate(potential(time)) * (law.target(potential(time)) - tension),
        (0.0, 20.0),
        np.zeros(cube.nodes),
        rtol=1e-10,
        atol=1e-12,
    ).y[:, -1]

    def errors(ramped: bool) -> np.ndarray:
        found = []
        for count in (100, 200, 400):
            unit = started(ActiveStress, cube, parameters=_GENTLE)
            for number in range(count):
                begin, end = (potential(20.0 * moment / count) for moment in (number, number + 1))
                unit.set("potential", begin)
                unit.do_step(0.02 * number / count, 0.02 / count, {"potential": end} if ramped else None)
            found.append(np.abs(unit.get("active_stress") - 1e3 * exact).max())
        return np.log2(np.array(found[:-1]) / np.array(found[1:]))

    np.testing.assert_allclose(errors(ramped=True), 2.0, atol=0.15)
    np.testing.assert_allclose(errors(ramped=False), 1.0, atol=0.15)


# --- electrophysiology --------------------------------------------------------------------------------------------


def test_ramped_stretch_makes_electrophysiology_second_order(bar: Any, started: Any) -> None:
    fiber = np.tile([1.0, 0.0, 0.0], (bar.elements, 1))
    centres = bar.points[bar.cells].mean(axis=1)[:, 0]

    def stretch(time: float) -> np.ndarray:
        return 1.0 + 0.02 * (1.0 + np.sin(0.3 * time + 0.1 * centres))

    def run(count: int, ramped: bool) -> np.ndarray:
        unit = started(Electrophysiology, bar, parameters={"longest_substep_ms": 0.0625}, fiber=fiber)
        for number in range(count):
            begin, end = (stretch(8.0 * moment / count) for moment in (number, number + 1))
            unit.set("stretch", begin)
            unit.do_step(0.008 * number / count, 0.008 / count, {"stretch": end} if ramped else None)
        return np.array(unit.get("potential"))

    for ramped, order in ((True, 2.0), (False, 1.0)):
        values = [run(count, ramped) for count in (4, 8, 16, 32)]
        changes = [np.abs(fine - coarse).max() for coarse, fine in pairwise(values)]
        np.testing.assert_allclose(np.log2(np.array(changes[:-1]) / np.array(changes[1:])), order, atol=0.25)


# --- ends and what is set --------------------------------------------------------------------------------------------


def _states(unit: Any) -> dict[str, bytes]:
    return {name: value.tobytes() for name, value in unit.get_state().state.items()}


@pytest.mark.parametrize("kind", [ActiveStress, Electrophysiology, Mass])
def test_an_end_that_is_where_the_input_begins_is_as_if_held(kind: Any, cube: Any, started: Any) -> None:
    # A master may give the ends of all inputs, of those too that do not change; the last bits are those of a held one.
    held, ramped = (started(kind, cube, {"k_c": 3.0} if kind is Mass else {}) for _ in range(2))
    ends = {}
    for item in kind.inputs():
        if not item.fixed:
            ends[item.name] = np.full(item.shape(cube), 10.0 if item.name == "potential" else 1.01)
            for unit in (held, ramped):
                unit.set(item.name, ends[item.name])
    held.do_step(0.0, 0.005)
    ramped.do_step(0.0, 0.005, ends)
    assert _states(held) == _states(ramped)


def test_an_input_without_an_end_is_held_beside_one_that_has_one(cube: Any, started: Any) -> None:
    parameters = {"k": 2.0, "k_c": 3.0, "c_c": 1.0}
    units = [started(Mass, cube, parameters, F_in=1.0, x_in=0.5) for _ in range(2)]
    units[0].do_step(0.0, 0.3, {"F_in": -2.0})
    units[1].do_step(0.0, 0.3, {"F_in": -2.0, "x_in": 0.5, "v_in": 0.0})
    assert _states(units[0]) == _states(units[1])


def test_after_the_step_inputs_are_what_was_set_and_the_next_step_holds_them(cube: Any, started: Any) -> None:
    # FMI's derivatives of inputs are of one step: the next begins without them (FMI 2.0.4, section 4.2.1).
    low, high = np.full(cube.nodes, -80.0), np.full(cube.nodes, 15.0)
    unit = started(ActiveStress, cube, potential=low)
    unit.do_step(0.0, 0.005, {"potential": high})
    np.testing.assert_array_equal(unit.get("potential"), low)
    reached = np.array(unit.get("active_stress"))
    assert reached.min() > 0.0
    unit.do_step(0.005, 0.005)
    # At the resting potential the tension falls at the slow rate, as it would not where a ramp went on.
    np.testing.assert_allclose(unit.get("active_stress"), reached * np.exp(-0.1 * 5.0), rtol=1e-12)


def test_a_step_that_fails_leaves_no_end_behind(cube: Any, started: Any) -> None:
    parameters, high = {"length_dependence": 2.0}, np.full(cube.nodes, 15.0)
    unit, undisturbed = (started(ActiveStress, cube, parameters, potential=high) for _ in range(2))
    for each in (unit, undisturbed):
        each.do_step(0.0, 0.005)
    before = _states(unit)
    with pytest.raises(StepFailure, match="length_dependence"):
        unit.do_step(0.005, 0.005, {"stretch": np.full(cube.elements, 0.1), "potential": -high})
    assert _states(unit) == before
    np.testing.assert_array_equal(unit.get("stretch"), 1.0)
    for each in (unit, undisturbed):
        each.do_step(0.005, 0.005)
    assert _states(unit) == _states(undisturbed)


@pytest.mark.parametrize("kind", UNITS.values(), ids=UNITS.keys())
def test_ends_are_refused_where_an_input_cannot_have_one(kind: Any, small_heart: Any, started: Any) -> None:
    # Memoryless units see the end of a step only; a fixed input, a parameter and an output have no other end.
    unit = started(kind, small_heart)
    before = _states(unit)
    refused = [item.name for item in kind.variables() if item.causality is not Causality.INPUT]
    refused += [item.name for item in kind.inputs() if item.fixed or not kind.interpolates]
    for name in refused:
        value = unit.get(name)
        with pytest.raises(InvalidInput, match=f"'{name}' of unit '{kind.name}' keeps its value over a step"):
            unit.do_step(0.0, 0.001, {name: value})
    with pytest.raises(InvalidInput, match=f"'{kind.name}' has no variable 'no_such'"):
        unit.do_step(0.0, 0.001, {"no_such": 1.0})
    assert _states(unit) == before


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (1.0, "got shape"),
        ([1.0, 2.0], "got shape"),
        (None, "has to be real numbers|got shape"),
        (np.nan, "is not finite"),
    ],
)
def test_an_end_has_to_be_a_value_that_could_be_set(value: Any, said: str, cube: Any, started: Any) -> None:
    unit = started(ActiveStress, cube)
    before = _states(unit)
    given = np.full(cube.nodes, value) if said == "is not finite" else value
    with pytest.raises(InvalidInput, match=f"'potential' of unit 'active_stress' ({said})"):
        unit.do_step(0.0, 0.001, {"potential": given})
    # A stretch that is none.
    with pytest.raises(InvalidInput, match="it has to be above 0"):
        unit.do_step(0.0, 0.001, {"stretch": np.zeros(cube.elements)})
    assert _states(unit) == before
