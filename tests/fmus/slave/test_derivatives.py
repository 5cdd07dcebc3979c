"""If these fail, a Newton-type master or a calibration that uses our FMUs follows slopes that they do not have."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.registry import UNITS

Make = Callable[..., Any]

#: As far as differences of fourth order can tell, relative to the largest number of a field.
_RELATIVE = 1e-6
#: Of what an input varies by, that much goes into a difference.
_SIZE = 2e-3
_SCALES = {"potential": 5.0, "stretch": 0.02, "active_stress": 2.0, "active_stiffness": 5.0, "reference_stretch": 0.01}
_SCALES |= {"lv_pressure": 0.1, "rv_pressure": 0.05}

_PARAMETERS: dict[str, dict[str, Any]] = {
    "active_stress": {"length_dependence": 0.7, "delay_slope_per_mV": 0.1},
    "mechanics": {"shear_modulus_MPa": 0.3, "equilibrium_tolerance": 1e-12},
}

Fields = Mapping[str, np.ndarray]


class _Point:
    """A unit through its FMU, at the end of a step that can be taken again with other inputs."""

    def __init__(self, unit: str, cases: Mapping[str, Any], make: Make) -> None:
        case = cases[unit]
        self.driver = make(unit)
        self.driver.start(_PARAMETERS[unit], case.first())
        assert self.driver.step(*case.steps[0], case.inputs[0]) == 0, self.driver.errors()
        self.inputs: Fields = case.inputs[1]
        self._step = case.steps[1]
        self._before = self.driver.save()
        self.knowns = list(self.inputs)
        self.unknowns = self.driver.names("output")
        self.values_at({})

    def values_at(self, changes: Fields) -> np.ndarray:
        """All outputs, one after the other, after the step with changed inputs."""
        self.driver.restore(self._before)
        changed = {name: values + changes.get(name, 0.0) for name, values in self.inputs.items()}
        assert self.driver.step(*self._step, changed) == 0, self.driver.errors()
        return np.array(self.driver.get(*self.unknowns))

    def differences(self, direction: Fields) -> np.ndarray:
        """Derivatives of all outputs along `direction`, by differences of fourth order."""

        def odd(size: float) -> np.ndarray:
            plus, minus = ({name: sign * size * values for name, values in direction.items()} for sign in (1, -1))
            return (self.values_at(plus) - self.values_at(minus)) / (2.0 * size)

        return (4.0 * odd(_SIZE) - odd(2.0 * _SIZE)) / 3.0

    def direction(self, seed: int, *names: str) -> dict[str, np.ndarray]:
        """A change of the inputs `names`, drawn at random."""
        random = np.random.default_rng(seed)
        return {name: _SCALES[name] * random.uniform(-1.0, 1.0, self.inputs[name].shape) for name in names}

    def along(self, direction: Fields) -> np.ndarray:
        """What the FMU says of the same."""
        seed = np.concatenate([np.ravel(values) for values in direction.values()])
        return np.array(self.driver.directional(self.unknowns, list(direction), seed))

    def by_name(self, values: np.ndarray) -> dict[str, np.ndarray]:
        ends = np.cumsum([self.driver.size(name) for name in self.unknowns])[:-1]
        return dict(zip(self.unknowns, np.split(values, ends), strict=True))


@pytest.fixture(params=_PARAMETERS)
def point(request: pytest.FixtureRequest, cases: dict, make: Make) -> _Point:
    return _Point(request.param, cases, make)


def test_directional_derivatives_are_those_of_the_step(point: _Point) -> None:
    moved: set[str] = set()
    # Each input by itself, and all at once.
    for seed, names in enumerate([*[(name,) for name in point.knowns], tuple(point.knowns)]):
        direction = point.direction(seed, *names)
        expected = point.by_name(point.differences(direction))
        point.values_at({})
        found = point.by_name(point.along(direction))
        for name, values in expected.items():
            scale = np.abs(values).max()
            np.testing.assert_allclose(
                found[name], values, rtol=0, atol=_RELATIVE * scale + 1e-12, err_msg=f"{name} {names}"
            )
            moved |= {name} if scale > 1e-6 else set()
    assert {"active_stress", "active_stress_mean"} <= moved or {"displacement", "stretch", "lv_volume"} <= moved
    assert point.driver.messages == []


def test_adjoint_derivatives_are_the_transposed_map(point: _Point) -> None:
    if point.driver.fmi == 2:
        # FMI 2.0 has none.
        assert not hasattr(point.driver, "adjoint")
        return
    random = np.random.default_rng(11)
    direction = point.direction(3, *point.knowns)
    changes = point.along(direction)
    weights = random.uniform(-1.0, 1.0, changes.shape)
    gradient = np.array(point.driver.adjoint(point.unknowns, point.knowns, weights))
    flat = np.concatenate([np.ravel(values) for values in direction.values()])
    terms = np.concatenate([weights * changes, gradient * flat])
    assert weights @ changes == pytest.approx(gradient @ flat, rel=0, abs=1e-11 * np.abs(terms).sum())
    assert np.abs(gradient).max() > 0.0
    # Some of the unknowns, some of the knowns.
    some, by = point.unknowns[:1], point.knowns[-1:]
    part = np.array(point.driver.adjoint(some, by, weights[: point.driver.size(some[0])]))
    whole = np.where(np.arange(len(weights)) < point.driver.size(some[0]), weights, 0.0)
    all_of_it = np.array(point.driver.adjoint(point.unknowns, point.knowns, whole))
    np.testing.assert_array_equal(part, all_of_it[-len(part) :])


def test_they_do_not_change_the_unit(point: _Point) -> None:
    before = point.driver.packed()
    first = point.along(point.direction(0, *point.knowns))
    assert point.driver.packed() == before
    # After other steps and back again: the same bits.
    state = point.driver.save()
    assert point.driver.step(point.driver.reached(), 1e-3) == 0
    assert point.driver.restore(state) == 0
    np.testing.assert_array_equal(point.along(point.direction(0, *point.knowns)), first)


def test_single_scalars_of_fields(cases: dict, fmus: dict, drive: Make) -> None:
    """In FMI 2.0 the derivative of any scalar by any other: pointwise, in active stress."""
    driver = drive(fmus["active_stress"])
    driver.start(_PARAMETERS["active_stress"] | {"length_dependence": 0.0}, cases["active_stress"].first())
    assert driver.step(0.0, 1e-3, cases["active_stress"].inputs[0]) == 0
    whole = driver.directional(["active_stress"], ["potential"], np.ones(16))

    def of_one(place: int, by: int) -> float:
        return _scalars(driver, [driver.references("active_stress")[place]], [driver.references("potential")[by]])[0]

    assert [of_one(place, place) for place in (0, 7, 15)] == [whole[place] for place in (0, 7, 15)]
    assert of_one(3, 4) == 0.0
    mean = _scalars(driver, driver.references("active_stress_mean"), [driver.references("potential")[5]])[0]
    assert mean == pytest.approx(whole[5] / 16, rel=1e-12)


def _scalars(driver: Any, unknowns: list[int], knowns: list[int]) -> list[float]:
    """Derivatives of scalars by the sum of others, by their value references."""
    return driver.derivative("GetDirectionalDerivative", unknowns, knowns, [1.0] * len(knowns), len(unknowns))


def test_what_has_no_derivative_is_told_by_name(point: _Point) -> None:
    driver = point.driver
    before = driver.packed()
    count = driver.size(point.knowns[0])
    parameter = driver.names("parameter")[1]
    wrong = [
        ([parameter], point.knowns[:1], [1.0] * count),
        (point.unknowns[:1], [parameter], [1.0]),
        (point.unknowns[:1], point.unknowns[1:2], [1.0] * driver.size(point.unknowns[1])),
        (point.unknowns[:1], point.knowns[:1], [*[1.0] * (count - 1), np.nan]),
    ]
    if driver.fmi == 3:
        wrong += [
            (point.unknowns[:1], point.knowns[:1], [1.0] * (count + 1)),
            (["time"], point.knowns[:1], [1.0] * count),
        ]
    if "fiber" in driver.names("input"):
        wrong += [(point.unknowns[:1], ["fiber"], [1.0] * driver.size("fiber"))]
    for unknowns, knowns, seed in wrong:
        assert np.isnan(driver.directional(unknowns, knowns, seed)).all(), (unknowns, knowns)
        assert driver.refused.pop()[1] == 3
        ((status, category, text),) = driver.messages
        assert (status, category) == (3, "invalidInput"), text
        assert "Traceback" not in text
        driver.messages.clear()
    assert driver.packed() == before


@pytest.mark.parametrize("unit", [name for name, unit in UNITS.items() if not unit.differentiable])
def test_units_without_derivatives_say_so(unit: str, cases: dict, make: Make) -> None:
    case = cases[unit]
    driver = make(unit)
    driver.start(case.parameters, case.first())
    known = (driver.names("input", moving=True) or driver.names("output"))[0]
    found = driver.directional(driver.names("output")[:1], [known], np.ones(driver.size(known)))
    assert np.isnan(found).all()
    assert driver.refused == [("GetDirectionalDerivative", 3)]
    assert f"unit '{unit}'" in driver.errors()
    case.run(driver)
