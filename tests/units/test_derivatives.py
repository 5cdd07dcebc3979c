"""If these fail, a Newton-type master or a calibration follows slopes that the units do not have."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.active_stress_derivative import exprel_slope
from cardiac_cosim.units.errors import CallOrderError, InvalidInput
from cardiac_cosim.units.mechanics import LocalMechanics, Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.snapshot import Snapshot
from cardiac_cosim.units.test_problems import Mass, Response
from cardiac_cosim.units.unit import Unit
from scipy.integrate import quad

#: How exact derivatives have to be, relative to the largest number of a field: that of a difference of fourth order.
_RELATIVE = 1e-6
#: What of a direction the differences take: so little that no maximum changes its place, and no fibre begins to pull.
_SIZE = 2e-3
#: What the transposed map may differ by, relative to what is added up.
_ADJOINT = 1e-12

#: Ranges of the inputs from which fields are drawn, and by which they are changed along a direction.
_RANGES = {
    "potential": (-60.0, 20.0, 5.0),
    "stretch": (0.9, 1.1, 0.05),
    "active_stress": (0.0, 40.0, 4.0),
    "active_stiffness": (20.0, 150.0, 20.0),
    "reference_stretch": (0.9, 1.0, 0.02),
    "lv_pressure": (0.5, 1.0, 0.2),
    "rv_pressure": (0.2, 0.4, 0.1),
}


@dataclass(frozen=True)
class _Case:
    """A unit with parameters on a mesh, and how its inputs are."""

    kind: type[Unit]
    parameters: dict[str, Any] = field(default_factory=dict)
    #: Whether inputs run to other ends.
    ramped: bool = False
    #: Inputs that stay zero; those that are zero in half of the places.
    zero: tuple[str, ...] = ()
    half: tuple[str, ...] = ()
    step_ms: float = 1.5


_TIGHT = {"equilibrium_tolerance": 1e-12}
_STIFF = {"element_order": 2, "epicardium_stiffness_kPa_per_mm": 3.0, "stabilization": 0.7}

_CASES = {
    "active_stress": _Case(ActiveStress),
    "active_stress-ramped": _Case(ActiveStress, {"delay_slope_per_mV": 0.05}, ramped=True),
    "active_stress-length": _Case(ActiveStress, {"length_dependence": 2.0}),
    "active_stress-length-ramped": _Case(ActiveStress, {"length_dependence": 2.0}, ramped=True, step_ms=20.0),
    "active_stress-euler": _Case(ActiveStress, {"time_integration": "forward_euler", "length_dependence": 2.0}),
    "active_stress-as_printed": _Case(
        ActiveStress,
        {"delay_function": "as_printed", "slow_rate_per_ms": 0.5, "fast_rate_per_ms": 0.8, "delay_slope_per_mV": 0.05},
        ramped=True,
    ),
    "active_stress-no_length": _Case(ActiveStress, {"length_dependence": 2.0}, step_ms=0.0),
    "mechanics": _Case(Mechanics, _TIGHT, half=("reference_stretch",)),
    "mechanics-without_stiffness": _Case(Mechanics, _TIGHT, zero=("active_stiffness",), half=("reference_stretch",)),
    "mechanics-not_stabilised": _Case(Mechanics, {**_TIGHT, "stabilization": 0.0}),
    "mechanics-own_stretch": _Case(Mechanics, _TIGHT, zero=("reference_stretch",)),
    "mechanics-no_length": _Case(Mechanics, _TIGHT, zero=("reference_stretch",), step_ms=0.0),
    "mechanics-guccione": _Case(Mechanics, {**_TIGHT, "material": "guccione"}, half=("active_stiffness",)),
    "mechanics-neo_hooke": _Case(Mechanics, {**_TIGHT, "material": "neo_hooke", "linear_solver": "superlu"}),
    "mechanics-quadratic": _Case(Mechanics, _TIGHT | _STIFF, half=("reference_stretch",)),
    "local_mechanics": _Case(LocalMechanics, half=("reference_stretch",)),
    "local_mechanics-without_stiffness": _Case(LocalMechanics, zero=("active_stiffness",)),
    "local_mechanics-guccione": _Case(LocalMechanics, {"material": "guccione", "stabilization": 0.5}),
    "local_mechanics-isometric": _Case(LocalMechanics, {"hold": "isometric"}),
    "mass": _Case(Mass, {"k": 3.0, "c": 0.2, "k_c": 2.0, "c_c": 1.0}, step_ms=300.0),
    "mass-ramped": _Case(Mass, {"k": 3.0, "c": 0.2, "k_c": 2.0, "c_c": 1.0}, ramped=True, step_ms=300.0),
    "response": _Case(Response, {"gain": 3.0, "rate_gain_ms": 2.0}),
    "response-delayed": _Case(Response, {"gain": 3.0, "rate_gain_ms": 2.0, "delay_rate_per_ms": 0.4}),
    "response-ramped": _Case(Response, {"gain": 3.0, "rate_gain_ms": 2.0, "delay_rate_per_ms": 0.4}, ramped=True),
    "response-no_length": _Case(Response, {"gain": 3.0, "rate_gain_ms": 2.0}, step_ms=0.0),
}


class _Taken:
    """A unit of a case that has taken a step, and can take it again with other inputs."""

    def __init__(self, case: _Case, mesh: Mesh, fixed: dict[str, np.ndarray], started: Callable[..., Unit]) -> None:
        self._case, self.mesh, self._random = case, mesh, np.random.default_rng(7)
        self._start, self._fixed = started, fixed
        self.given = self.drawn()
        self.ends = self.drawn() if case.ramped else {}
        self.unit = self.fresh(self.given)
        # Two steps before, so that no state is that of the start.
        for number in range(2):
            self._set(self.drawn())
            self.unit.do_step(2e-3 * number, 2e-3)
        self.saved = self.unit.get_state()
        self.step(self.given, self.ends)
        self.reached = self.unit.get_state()

    def begin_anew(self) -> None:
        """For the next test: at the end of the step, and the same random numbers whatever was before."""
        self.unit.set_state(self.reached)
        self._random = np.random.default_rng(11)

    def fresh(self, inputs: dict[str, np.ndarray]) -> Unit:
        fixed = {
            name: value for name, value in self._fixed.items() if name in {i.name for i in self._case.kind.inputs()}
        }
        return self._start(self._case.kind, self.mesh, self._case.parameters, **fixed, **inputs)

    def step(self, inputs: dict[str, np.ndarray], ends: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The outputs after the step with other inputs."""
        self.unit.set_state(self.saved)
        self._set(inputs)
        self.unit.do_step(4e-3, 1e-3 * self._case.step_ms, ends)
        return self.outputs()

    def outputs(self, unit: Unit | None = None) -> dict[str, np.ndarray]:
        unit = unit or self.unit
        return {variable.name: np.array(unit.get(variable.name)) for variable in unit.outputs()}

    def drawn(self) -> dict[str, np.ndarray]:
        """Random values of all inputs that may change."""
        values = {}
        for item in self.moving():
            low, high, _ = _RANGES.get(item.name, (-1.0, 1.0, 0.5))
            values[item.name] = self._random.uniform(low, high, item.shape(self.mesh))
            if item.name in self._case.zero:
                values[item.name] = np.zeros_like(values[item.name])
            if item.name in self._case.half:
                values[item.name] = np.where(self._random.random(values[item.name].shape) < 0.5, 0.0, values[item.name])
        return values

    def direction(self, name: str) -> np.ndarray:
        """A random change of an input; of a stretch that is the unit's own there is none."""
        change = _RANGES.get(name, (-1.0, 1.0, 0.5))[2]
        values = change * self._random.uniform(-1.0, 1.0, self.unit.variable(name).shape(self.mesh))
        return np.where(self.given[name], values, 0.0) if name == "reference_stretch" else values

    def weights(self) -> dict[str, np.ndarray]:
        return {item.name: self._random.uniform(-1.0, 1.0, item.shape(self.mesh)) for item in self.unit.outputs()}

    def moving(self) -> list[Any]:
        return [item for item in self._case.kind.inputs() if not item.fixed]

    def moved(self, values: dict[str, np.ndarray], name: str, change: np.ndarray) -> dict[str, np.ndarray]:
        return values | {name: values[name] + change} if name in values else values

    def _set(self, inputs: dict[str, np.ndarray]) -> None:
        for name, value in inputs.items():
            self.unit.set(name, value)


@pytest.fixture(scope="module")
def taken(two_chambers: Mesh, box: Any, started: Any, frames_of: Any) -> Callable[[str], _Taken]:
    """The unit of a case after its step, made once."""
    made: dict[str, _Taken] = {}

    def make(name: str) -> _Taken:
        if name not in made:
            case = _CASES[name]
            mesh = two_chambers if case.kind is Mechanics else box([0.0, 1.0, 3.0], [0.0, 1.0], [-1.0, 0.0])
            made[name] = _Taken(case, mesh, frames_of(mesh.elements), started)
        made[name].begin_anew()
        return made[name]

    return make


@pytest.fixture(scope="module")
def frames_of() -> Callable[[int], dict[str, np.ndarray]]:
    """Fibres and sheets that vary from element to element."""

    def make(elements: int) -> dict[str, np.ndarray]:
        angle = 0.4 * np.sin(np.arange(elements))
        fiber = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        return {"fiber": fiber, "sheet": np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)}

    return make


each_case = pytest.mark.parametrize("name", _CASES)
each_input = pytest.mark.parametrize(
    ("name", "of"),
    [(name, item.name) for name, case in _CASES.items() for item in case.kind.inputs() if not item.fixed],
)


def _difference(at: Callable[[float], dict[str, np.ndarray]], size: float) -> dict[str, np.ndarray]:
    """The derivative of `at` at 0 by a central difference of fourth order."""
    two_back, back, ahead, two_ahead = (at(step * size) for step in (-2.0, -1.0, 1.0, 2.0))
    return {
        name: (two_back[name] - two_ahead[name] + 8.0 * (ahead[name] - back[name])) / (12.0 * size) for name in back
    }


def _compare(found: dict[str, np.ndarray], expected: dict[str, np.ndarray], shown: dict[str, np.ndarray]) -> None:
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name].shape == value.shape, name
        # What does not follow the input differs by the rounding of the output.
        rounding = 1e-8 * float(np.abs(shown[name]).max())
        largest = float(np.abs(value).max())
        np.testing.assert_allclose(found[name], value, rtol=0.0, atol=_RELATIVE * largest + rounding, err_msg=name)


def test_every_unit_that_says_so_is_here() -> None:
    assert {case.kind for case in _CASES.values()} == {kind for kind in UNITS.values() if kind.differentiable}


# --- against differences ------------------------------------------------------------------------------------------


@each_input
def test_it_is_what_the_step_does_when_it_is_repeated_with_other_inputs(name: str, of: str, taken: Any) -> None:
    unit = taken(name)
    direction = unit.direction(of)
    found = unit.unit.directional_derivative({of: direction})

    def at(size: float) -> dict[str, np.ndarray]:
        change = size * direction
        return unit.step(unit.moved(unit.given, of, change), unit.moved(unit.ends, of, change))

    _compare(found, _difference(at, _SIZE), unit.outputs())


@each_input
def test_in_initialization_mode_and_until_the_first_step_it_is_that_of_the_initial_outputs(
    name: str, of: str, taken: Any
) -> None:
    unit = taken(name)
    direction = unit.direction(of)
    initialised = unit.fresh(unit.given)
    found = initialised.directional_derivative({of: direction})
    expected = _difference(lambda size: unit.outputs(unit.fresh(unit.moved(unit.given, of, size * direction))), _SIZE)
    _compare(found, expected, unit.outputs(initialised))
    # What is set for the first step does not count before it.
    for item in unit.moving():
        initialised.set(item.name, unit.drawn()[item.name])
    again = initialised.directional_derivative({of: direction})
    earlier = type(initialised)(unit.mesh)
    earlier.set_state(initialised.get_state())
    earlier.set_state(_in_initialization_mode(initialised, unit))
    foreseen = earlier.directional_derivative({of: direction})
    for each in (again, foreseen):
        assert {key: value.tobytes() for key, value in each.items()} == {k: v.tobytes() for k, v in found.items()}


def _in_initialization_mode(initialised: Unit, unit: _Taken) -> Snapshot:
    """The state of an instance that is in initialization mode, with the inputs that the other was initialised with."""
    other = type(initialised)(unit.mesh)
    other.instantiate(dict(initialised.get_state().parameters))
    other.setup_experiment()
    other.enter_initialization_mode()
    for item in other.inputs():
        other.set(item.name, unit.given[item.name] if item.name in unit.given else initialised.get(item.name))
    return other.get_state()


# --- the two directions -------------------------------------------------------------------------------------------


@each_case
def test_the_adjoint_is_the_transpose(name: str, taken: Any) -> None:
    unit = taken(name)
    changes = {item.name: unit.direction(item.name) for item in unit.moving()}
    weights = unit.weights()
    along, back = unit.unit.directional_derivative(changes), unit.unit.adjoint_derivative(weights)
    assert back.keys() == changes.keys()
    forward = [np.sum(along[key] * weights[key]) for key in weights]
    backward = [np.sum(back[key] * changes[key]) for key in changes]
    terms = sum(float(np.sum(np.abs(along[key] * weights[key]))) for key in weights)
    assert abs(sum(forward) - sum(backward)) <= _ADJOINT * terms
    # Also output by output: a mistake in one would drown in another's size.
    for key in weights:
        single = unit.unit.adjoint_derivative({key: weights[key]})
        total = sum(float(np.sum(single[item] * changes[item])) for item in changes)
        scale = float(np.sum(np.abs(along[key] * weights[key])))
        assert abs(total - float(np.sum(along[key] * weights[key]))) <= 10.0 * _ADJOINT * scale + 1e-16 * terms, key


@each_case
def test_it_is_linear_and_inputs_that_are_not_named_do_not_change(name: str, taken: Any) -> None:
    unit = taken(name)
    changes = {item.name: unit.direction(item.name) for item in unit.moving()}
    whole = unit.unit.directional_derivative(changes)
    parts = [unit.unit.directional_derivative({key: -2.0 * value}) for key, value in changes.items()]
    for key, value in whole.items():
        np.testing.assert_allclose(-0.5 * sum(part[key] for part in parts), value, rtol=1e-9, atol=1e-13)
    assert not any(np.any(value) for value in unit.unit.directional_derivative({}).values())
    assert not any(np.any(value) for value in unit.unit.adjoint_derivative({}).values())


# --- states -------------------------------------------------------------------------------------------------------


@each_case
def test_a_state_gives_the_bits_that_it_was_saved_with(name: str, taken: Any, started: Any) -> None:
    unit = taken(name)
    changes = {item.name: unit.direction(item.name) for item in unit.moving()}
    weights = unit.weights()

    def bits(of: Unit) -> list[bytes]:
        both = of.directional_derivative(changes), of.adjoint_derivative(weights)
        return [value.tobytes() for derivatives in both for value in derivatives.values()]

    before = bits(unit.unit)
    # What is set after the step, and another step, leave no trace.
    for key, value in unit.drawn().items():
        unit.unit.set(key, value)
    assert bits(unit.unit) == before
    unit.unit.do_step(6e-3, 1e-3)
    if name != "response-ramped":
        assert bits(unit.unit) != before or "isometric" in name
    unit.unit.set_state(unit.reached)
    assert bits(unit.unit) == before
    other = type(unit.unit)(unit.mesh)
    data = unit.reached.to_bytes()
    other.set_state(Snapshot.from_bytes(data))
    assert bits(other) == before
    other.terminate()
    assert bits(other) == before


def test_a_failed_step_leaves_the_derivative_of_the_one_before(taken: Any) -> None:
    unit = taken("active_stress-length")
    seed = {"potential": np.ones(unit.mesh.nodes)}
    before = unit.unit.directional_derivative(seed)
    unit.unit.set("stretch", np.full(unit.mesh.elements, 0.1))
    with pytest.raises(Exception, match="length_dependence"):
        unit.unit.do_step(6e-3, 1e-3)
    after = unit.unit.directional_derivative(seed)
    assert {key: value.tobytes() for key, value in after.items()} == {k: v.tobytes() for k, v in before.items()}


def test_a_step_that_nobody_differentiates_costs_references_only(taken: Any) -> None:
    unit = taken("mechanics")
    snapshot = unit.unit.get_state()
    assert snapshot.taken is not None
    assert all(snapshot.taken.before[name] is value for name, value in unit.saved.state.items())
    # Inputs that are held are the same arrays, and in bytes they are there once.
    assert snapshot.taken.begin is snapshot.taken.inputs
    assert all(snapshot.taken.inputs[name] is value for name, value in snapshot.inputs.items())
    alone = len(Snapshot.to_bytes(replace(snapshot, taken=None)))
    assert len(snapshot.to_bytes()) < alone + sum(value.nbytes for value in snapshot.taken.before.values())


# --- what is refused ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["active_stress-length", "mechanics", "local_mechanics", "mass", "response"])
def test_senseless_seeds_are_refused_by_name(name: str, taken: Any) -> None:
    unit = taken(name).unit
    inputs = [item.name for item in unit.inputs() if not item.fixed]
    outputs = [item.name for item in unit.outputs()]
    others = [item.name for item in unit.variables() if item.name not in (*inputs, *outputs)]
    for wrong in (*outputs, *others):
        with pytest.raises(InvalidInput, match=f"'{wrong}' of unit '{unit.name}' is not an input that may change"):
            unit.directional_derivative({wrong: unit.get(wrong)})
    for wrong in (*inputs, *others):
        with pytest.raises(InvalidInput, match=f"'{wrong}' of unit '{unit.name}' is not an output"):
            unit.adjoint_derivative({wrong: unit.get(wrong)})
    for derivative, key in ((unit.directional_derivative, inputs[0]), (unit.adjoint_derivative, outputs[0])):
        with pytest.raises(InvalidInput, match=f"unit '{unit.name}' has no variable 'no_such'"):
            derivative({"no_such": 1.0})
        with pytest.raises(InvalidInput, match=f"put '{key}' of unit '{unit.name}' got shape"):
            derivative({key: np.zeros((2, 5))})
        with pytest.raises(InvalidInput, match=f"put '{key}' of unit '{unit.name}' is not finite"):
            derivative({key: np.full(np.shape(unit.get(key)), np.nan)})
        with pytest.raises(InvalidInput, match="has to be real numbers"):
            derivative({key: "much"})


@pytest.mark.parametrize("kind", UNITS.values(), ids=UNITS.keys())
def test_units_without_derivatives_say_so_and_the_others_have_them_from_initialization_mode_on(
    kind: Any, small_heart: Mesh
) -> None:
    unit = kind(small_heart)
    for derivative in (unit.directional_derivative, unit.adjoint_derivative):
        if kind.differentiable:
            with pytest.raises(CallOrderError, match=f"'{kind.name}' is instantiated"):
                derivative({})
        else:
            with pytest.raises(InvalidInput, match=f"'{kind.name}' gives no derivatives"):
                derivative({})
    unit.enter_initialization_mode()
    if kind.differentiable:
        assert unit.directional_derivative({}).keys() == {item.name for item in unit.outputs()}
        assert unit.adjoint_derivative({}).keys() == {item.name for item in unit.inputs() if not item.fixed}


def test_a_state_that_does_not_know_its_step_says_so(taken: Any) -> None:
    unit = taken("response").unit
    unit.set_state(replace(unit.get_state(), taken=None))
    with pytest.raises(InvalidInput, match="does not say which step it came from"):
        unit.directional_derivative({"u": 1.0})
    unit.do_step(6e-3, 1e-3)
    assert unit.directional_derivative({"u": 1.0})["y"] == pytest.approx(3.0 + 2.0)


# --- closed forms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [0.0, -1e-12, -1e-3, -0.4999, -0.5001, -3.0, -40.0, -1e4])
def test_the_slope_of_a_mean_decay_is_its_integral(x: float) -> None:
    exact = quad(
        lambda m: m * np.exp(m * x), 0.0, 1.0, epsabs=0.0, epsrel=1e-13, points=[min(1.0, -10.0 / min(x, -1e-3))]
    )
    assert float(exprel_slope(np.asarray(x))) == pytest.approx(exact[0], rel=1e-12)


def test_a_loop_of_active_stress_and_mechanics_has_the_gain_of_its_derivatives(box: Any, started: Any) -> None:
    # A cube that nothing holds, pulled together by its own stretch: what comes back is the product of two derivatives.
    mesh = box([0.0, 1.0], [0.0, 1.0], [-1.0, 0.0])
    stress = started(ActiveStress, mesh, {"length_dependence": 2.0}, potential=np.full(mesh.nodes, 10.0))
    mechanics = started(LocalMechanics, mesh)
    stress.do_step(0.0, 0.05)
    mechanics.set("active_stress", stress.get("active_stress"))
    mechanics.do_step(0.0, 0.05)
    change = stress.directional_derivative({"stretch": np.ones(mesh.elements)})["active_stress"]
    back = mechanics.directional_derivative({"active_stress": change})["stretch"]
    by_hand = 1e-3 * change.mean() * mechanics.stretch_response()(np.ones(mesh.nodes))
    np.testing.assert_allclose(back, by_hand, rtol=1e-10)
    assert (back < 0.0).all()
