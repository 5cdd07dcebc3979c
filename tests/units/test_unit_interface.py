"""If these fail, no master can rely on the units: wrong input passes unnoticed, or a repeated step gives other bits."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.eikonal import Eikonal
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.electrophysiology.ionic.registry import IONIC_MODELS
from cardiac_cosim.units.errors import CallOrderError, InvalidInput, StepFailure
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.mechanics import LocalMechanics, Mechanics
from cardiac_cosim.units.mechanics.laws.registry import MATERIALS
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.phase import Phase
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.snapshot import Snapshot
from cardiac_cosim.units.test_problems import Mass, Response
from cardiac_cosim.units.unit import Unit
from cardiac_cosim.units.variable import Causality, Location, Variable, parameters_of


@dataclass(frozen=True)
class _Scene:
    """How to bring one unit to life on the small mesh, move it, and make it fail."""

    kind: type[Unit]
    #: A parameter and a value that changes the result.
    other: tuple[str, Any]
    #: Inputs that differ from the start's, as functions of the mesh and a number.
    moving: dict[str, Callable[[Mesh, int], np.ndarray]] = field(default_factory=dict)
    #: Inputs whose step fails, and parameters under which they do.
    failing: dict[str, Callable[[Mesh], np.ndarray]] = field(default_factory=dict)
    parameters: dict[str, Any] = field(default_factory=dict)


def _wave(mesh: Mesh, number: int, nodes: bool) -> np.ndarray:
    places = mesh.points if nodes else mesh.centroids
    return 0.5 + 0.5 * np.sin(0.2 * places[:, 0] + 0.3 * places[:, 2] + number)


#: How an active stress depends on the stretch; in some elements the mechanics takes the stretch that it has itself.
_STIFFNESS = {
    "active_stiffness": lambda mesh, number: 300.0 * _wave(mesh, number, nodes=True),
    "reference_stretch": lambda mesh, number: np.where(_wave(mesh, number, nodes=False) > 0.5, 0.95, 0.0),
}

_SCENES = [
    _Scene(FiberGenerator, ("endocardial_angle_deg", 50.0)),
    _Scene(
        Electrophysiology,
        ("stretch_conductance", 5.0),
        moving={"stretch": lambda mesh, number: 0.9 + 0.2 * _wave(mesh, number, nodes=False)},
        failing={"stretch": lambda mesh: np.full(mesh.elements, 1.7e308)},
    ),
    _Scene(Eikonal, ("excitation_rate", 7.0)),
    _Scene(
        ActiveStress,
        ("length_dependence", 0.5),
        moving={
            "potential": lambda mesh, number: -80.0 + 100.0 * _wave(mesh, number, nodes=True),
            "stretch": lambda mesh, number: 0.9 + 0.2 * _wave(mesh, number, nodes=False),
        },
        failing={"stretch": lambda mesh: np.full(mesh.elements, 0.1)},
        parameters={"length_dependence": 2.0},
    ),
    _Scene(
        Mechanics,
        ("shear_modulus_MPa", 0.3),
        moving={"active_stress": lambda mesh, number: 200.0 * _wave(mesh, number, nodes=True), **_STIFFNESS},
        failing={"active_stress": lambda mesh: np.full(mesh.nodes, -5000.0)},
    ),
    _Scene(
        LocalMechanics,
        ("shear_modulus_MPa", 0.3),
        # Where it is negative the fibre is in tension, and its stiffness counts.
        moving={"active_stress": lambda mesh, number: 200.0 * _wave(mesh, number, nodes=True) - 40.0, **_STIFFNESS},
        failing={"active_stress": lambda mesh: np.full(mesh.nodes, -5000.0)},
    ),
    _Scene(
        Mass,
        ("x_start", 0.7),
        moving={
            "F_in": lambda mesh, number: np.asarray(0.3 + np.sin(number)),
            "x_in": lambda mesh, number: np.asarray(0.2 + np.cos(number)),
            "v_in": lambda mesh, number: np.asarray(0.1 - np.sin(number)),
        },
        failing={"F_in": lambda mesh: np.asarray(1.7e308), "x_in": lambda mesh: np.asarray(1.7e308)},
        parameters={"k": 3.0, "k_c": 2.0, "c_c": 1.0},
    ),
    _Scene(
        Response,
        ("disturbance", 0.7),
        moving={"u": lambda mesh, number: np.asarray(0.3 + np.sin(number))},
        failing={"u": lambda mesh: np.asarray(1.7e308)},
        parameters={"gain": 20.0, "delay_rate_per_ms": 0.4, "rate_gain_ms": 1.0},
    ),
]

each_unit = pytest.mark.parametrize("scene", _SCENES, ids=lambda scene: scene.kind.name)
each_unit_with_inputs = pytest.mark.parametrize(
    "scene", [scene for scene in _SCENES if scene.moving], ids=lambda scene: scene.kind.name
)
each_unit_with_fields = pytest.mark.parametrize(
    "scene",
    [scene for scene in _SCENES if scene.moving and scene.kind not in (Mass, Response)],
    ids=lambda scene: scene.kind.name,
)
each_unit_with_memory = pytest.mark.parametrize(
    "scene",
    [scene for scene in _SCENES if scene.kind in (Electrophysiology, ActiveStress, Mass, Response)],
    ids=lambda s: s.kind.name,
)


@pytest.fixture(scope="module")
def mesh(two_chambers) -> Mesh:
    """The chambers with a sloping bottom: no wall is horizontal."""
    x, y, z = two_chambers.points.T
    sloping = z * (1.0 + 0.011 * x + 0.007 * y)
    return Mesh(np.stack([x, y, sloping], axis=1), two_chambers.cells, two_chambers.boundaries)


@pytest.fixture(scope="module")
def directions(mesh, started) -> dict[str, np.ndarray]:
    generator = started(FiberGenerator, mesh)
    return {name: generator.get(name) for name in ("fiber", "sheet")}


@pytest.fixture(scope="module")
def alive(mesh, directions, started):
    """A unit after initialisation."""

    def make(scene: _Scene, on: Mesh | None = None, **parameters: Any) -> Unit:
        inputs = {
            variable.name: directions[variable.name]
            for variable in scene.kind.fields
            if variable.causality is Causality.INPUT and variable.fixed and on is None
        }
        return started(scene.kind, on or mesh, scene.parameters | parameters, **inputs)

    return make


def _move(scene: _Scene, unit: Unit, steps: int, first: int = 0) -> None:
    for number in range(first, first + steps):
        for name, value in scene.moving.items():
            unit.set(name, value(unit.mesh, number))
        unit.do_step(1e-3 * number, 1e-3)


def _outputs(unit: Unit) -> dict[str, bytes]:
    return {variable.name: np.asarray(unit.get(variable.name)).tobytes() for variable in unit.outputs()}


def _bits(unit: Unit) -> dict[str, bytes]:
    """Everything a later step can depend on, and everything shown."""
    snapshot = unit.get_state()
    return (
        {f"state/{name}": value.tobytes() for name, value in snapshot.state.items()}
        | {f"input/{name}": value.tobytes() for name, value in snapshot.inputs.items()}
        | _outputs(unit)
    )


def test_every_registered_unit_is_tested_here() -> None:
    assert {scene.kind for scene in _SCENES} == set(UNITS.values())
    assert all(UNITS[scene.kind.name] is scene.kind for scene in _SCENES)


# --- declaration ---------------------------------------------------------------------------------------------------


@each_unit
def test_dependencies_exist(scene: _Scene) -> None:
    variables = scene.kind.variables()
    inputs = {variable.name for variable in variables if variable.causality is Causality.INPUT}
    parameters = {variable.name for variable in variables if variable.causality is Causality.PARAMETER}
    for variable in variables:
        assert set(variable.depends_on) <= inputs
        assert variable.needs is None or variable.needs in parameters
        assert variable.description
        assert variable.unit


@pytest.mark.parametrize("taken", ["potential", "slow_rate_per_ms", "active_stress_max"])
def test_a_name_that_is_declared_twice_is_refused(taken: str) -> None:
    # As a field and again, as a parameter, and as what is derived from a field.
    again = Variable(taken, Causality.OUTPUT, "1", "another of that name")
    kind = type("Twice", (ActiveStress,), {"fields": (*ActiveStress.fields, again)})
    with pytest.raises(TypeError, match=f"'{taken}' is declared twice"):
        kind.variables()


@each_unit
def test_outputs_have_the_declared_shape_and_are_read_only(scene: _Scene, mesh, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 1)
    for variable in (*unit.inputs(), *unit.outputs()):
        value = np.asarray(unit.get(variable.name))
        assert value.shape == variable.shape(mesh)
        assert value.dtype == np.float64
        if variable.location is not Location.GLOBAL:
            with pytest.raises(ValueError, match="read-only"):
                value[...] = 0.0


@each_unit
def test_default_parameters_pass_their_own_checks(scene: _Scene) -> None:
    unit = scene.kind.__new__(scene.kind)
    Unit.__init__(unit, None)  # type: ignore[arg-type]
    for variable in scene.kind.variables():
        if variable.causality is Causality.PARAMETER:
            unit.set(variable.name, variable.start)
            assert unit.get(variable.name) == variable.start
            assert type(unit.get(variable.name)) is type(variable.start)


@each_unit
def test_outputs_follow_no_input_they_do_not_declare(scene: _Scene, alive) -> None:
    for variable in scene.kind.outputs():
        for name in scene.moving.keys() - set(variable.depends_on):
            units = [alive(scene), alive(scene)]
            units[1].set(name, scene.moving[name](units[1].mesh, 3))
            for unit in units:
                unit.do_step(0.0, 0.001)
            assert _outputs(units[0])[variable.name] == _outputs(units[1])[variable.name]


@each_unit_with_inputs
def test_outputs_follow_the_inputs_they_declare(scene: _Scene, alive) -> None:
    still, moved = alive(scene), alive(scene)
    still.do_step(0.0, 0.001)
    _move(scene, moved, 1)
    dependent = [
        variable.name
        for variable in scene.kind.outputs()
        if variable.depends_on and not variable.name.startswith("activation_time")
    ]
    assert dependent
    for name in dependent:
        assert _outputs(still)[name] != _outputs(moved)[name], name


# --- order of calls ------------------------------------------------------------------------------------------------


@each_unit
def test_calls_out_of_order_are_refused(scene: _Scene, mesh, alive) -> None:
    unit = scene.kind(mesh)
    for early in (
        unit.exit_initialization_mode,
        unit.terminate,
        lambda: unit.do_step(0.0, 0.001),
        lambda: unit.get(scene.kind.outputs()[0].name),
        lambda: unit.get(scene.kind.outputs()[-1].name),
    ):
        with pytest.raises(CallOrderError, match=f"'{scene.kind.name}' is instantiated; this call needs it to be"):
            early()
    unit.enter_initialization_mode()
    for early in (
        unit.enter_initialization_mode,
        unit.setup_experiment,
        lambda: unit.do_step(0.0, 0.0),
    ):
        with pytest.raises(CallOrderError, match="in initialization mode"):
            early()
    ready = alive(scene)
    for late in (
        ready.enter_initialization_mode,
        ready.exit_initialization_mode,
        ready.setup_experiment,
        lambda: ready.instantiate({}),
        lambda: ready.set(scene.other[0], scene.other[1]),
    ):
        with pytest.raises(CallOrderError, match="is initialized"):
            late()
    shown = _outputs(ready)
    ready.terminate()
    assert _outputs(ready) == shown
    for late in (ready.terminate, lambda: ready.do_step(0.0, 0.001)):
        with pytest.raises(CallOrderError, match="is terminated"):
            late()


@each_unit
def test_fixed_inputs_are_fixed_after_initialisation(scene: _Scene, alive) -> None:
    unit = alive(scene)
    for variable in scene.kind.fields:
        if variable.causality is Causality.INPUT and variable.fixed:
            # Masters that set every input before every step do not mean to change them.
            unit.set(variable.name, np.array(unit.get(variable.name)))
            with pytest.raises(CallOrderError, match=f"'{variable.name}' .* fixed after initialisation"):
                unit.set(variable.name, -np.asarray(unit.get(variable.name)))


@each_unit
def test_outputs_in_initialization_mode_are_those_after_it(scene: _Scene, mesh, alive) -> None:
    ready, unit = alive(scene), scene.kind(mesh)
    names = [variable.name for variable in scene.kind.outputs()]
    unit.enter_initialization_mode()
    # Before any direction is given.
    assert all(np.isfinite(unit.get(name)).all() for name in names)
    for variable in scene.kind.inputs():
        unit.set(variable.name, ready.get(variable.name))
    foreseen = {name: np.array(unit.get(name)) for name in names}
    unit.set(scene.other[0], scene.other[1])
    changed = {name: np.array(unit.get(name)) for name in names}
    unit.exit_initialization_mode()
    for name in names:
        np.testing.assert_array_equal(unit.get(name), changed[name])
    again = scene.kind(mesh)
    again.enter_initialization_mode()
    for variable in scene.kind.inputs():
        again.set(variable.name, ready.get(variable.name))
    again.exit_initialization_mode()
    for name in names:
        np.testing.assert_array_equal(again.get(name), foreseen[name])


@each_unit
def test_directions_that_nobody_gives_are_unit_vectors(scene: _Scene, mesh) -> None:
    # A tool that simulates one unit by itself sets nothing.
    unit = scene.kind(mesh)
    unit.enter_initialization_mode()
    for variable in scene.kind.inputs():
        if variable.fixed:
            assert variable.stand_in
            np.testing.assert_allclose(np.linalg.norm(unit.get(variable.name), axis=1), 1.0, rtol=1e-15)
    unit.exit_initialization_mode()
    _move(scene, unit, 2)


@each_unit
def test_experiment_starts_at_zero_where_there_is_a_memory(scene: _Scene, mesh) -> None:
    unit = scene.kind(mesh)
    unit.setup_experiment(0.0, 0.5)
    if scene.kind.memoryless:
        unit.setup_experiment(0.1)
        return
    with pytest.raises(InvalidInput, match=r"starts at t = 0 s, not at 0\.1 s"):
        unit.setup_experiment(0.1)


@each_unit
@pytest.mark.parametrize(("time", "step"), [(0.0, -1e-9), (0.0, np.nan), (np.inf, 0.001), (0.0, np.inf), (np.nan, 0.0)])
def test_senseless_steps_are_refused(scene: _Scene, time: float, step: float, alive) -> None:
    unit = alive(scene)
    before = _bits(unit)
    with pytest.raises(InvalidInput, match="both have to be finite, the step >= 0"):
        unit.do_step(time, step)
    assert _bits(unit) == before


# --- wrong values --------------------------------------------------------------------------------------------------


@each_unit
def test_unknown_variables_are_refused(scene: _Scene, mesh, alive) -> None:
    for call in (
        lambda: scene.kind(mesh).instantiate({"no_such": 1.0}),
        lambda: alive(scene).set("no_such", 1.0),
        lambda: alive(scene).get("no_such"),
    ):
        with pytest.raises(InvalidInput, match=f"'{scene.kind.name}' has no variable 'no_such'"):
            call()


def _wrong_parameters() -> list[Any]:
    cases = []
    for scene in _SCENES:
        for variable in scene.kind.variables():
            if variable.causality is not Causality.PARAMETER:
                continue
            wrong: list[Any] = [None, [1.0], True]
            if isinstance(variable.start, str):
                wrong += ["no_such", 1.0, ""]
            else:
                wrong += ["much", np.nan, np.inf, -np.inf, 1j]
                wrong += [1.5] if isinstance(variable.start, int) else []
                if variable.above is not None:
                    wrong += [variable.above, variable.above - 1.0]
                if variable.at_least is not None:
                    wrong.append(np.nextafter(variable.at_least, -np.inf))
                if variable.below is not None:
                    wrong += [variable.below, variable.below + 1.0]
            cases += [
                pytest.param(scene.kind, variable.name, value, id=f"{scene.kind.name}-{variable.name}-{value!r}")
                for value in wrong
            ]
    return cases


@pytest.mark.parametrize(("kind", "name", "value"), _wrong_parameters())
def test_wrong_parameters_are_refused_by_name(kind: type[Unit], name: str, value: Any, mesh) -> None:
    unit = kind(mesh)
    with pytest.raises(InvalidInput, match=f"parameter '{name}' is "):
        unit.set(name, value)
    assert unit.get(name) == kind.variable(name).start


def test_limits_themselves_are_on_the_right_side(mesh) -> None:
    unit = Electrophysiology(mesh)
    unit.set("stretch_conductance", 0.0)
    unit.set("excitation_threshold", 0)
    assert unit.get("excitation_threshold") == 0.0
    assert isinstance(unit.get("excitation_threshold"), float)
    unit.set("excitation_threshold", np.nextafter(0.5, 0.0))
    other = Mechanics(mesh)
    other.set("newton_iterations", 7.0)
    assert other.get("newton_iterations") == 7
    assert isinstance(other.get("newton_iterations"), int)


@each_unit_with_fields
def test_wrong_fields_are_refused(scene: _Scene, mesh, alive) -> None:
    unit = alive(scene)
    for name, value in scene.moving.items():
        before = _bits(unit)
        good = value(mesh, 0)
        for shape in ((), (1,), (len(good) + 1,), (len(good), 1)):
            with pytest.raises(InvalidInput, match=f"input '{name}' .* got shape .* expected \\({len(good)},\\)"):
                unit.set(name, np.ones(shape))
        for bad in (np.nan, np.inf, -np.inf):
            broken = good.copy()
            broken[[17, 30]] = bad
            place = scene.kind.variable(name).location.value
            with pytest.raises(InvalidInput, match=f"input '{name}' .* is not finite at {place} \\[17\\]"):
                unit.set(name, broken)
        assert _bits(unit) == before


def test_vector_fields_name_element_and_component(mesh, directions) -> None:
    unit = Mechanics(mesh)
    broken = directions["fiber"].copy()
    broken[11, 2] = np.nan
    with pytest.raises(InvalidInput, match=r"'fiber' .* not finite at element \[11, 2\]"):
        unit.set("fiber", broken)
    with pytest.raises(InvalidInput, match=r"'fiber' .* got shape"):
        unit.set("fiber", directions["fiber"].T)


@each_unit_with_inputs
@pytest.mark.parametrize("value", ["rest", [[1.0], [1.0, 2.0]], None, [1j]])
def test_fields_that_are_no_numbers_are_refused_by_name(scene: _Scene, value: Any, alive) -> None:
    name = next(iter(scene.moving))
    with pytest.raises(InvalidInput, match=f"'{name}'"):
        alive(scene).set(name, value)


@each_unit
def test_outputs_cannot_be_set(scene: _Scene, alive) -> None:
    for unit in (alive(scene), scene.kind(alive(scene).mesh)):
        for variable in scene.kind.outputs():
            with pytest.raises(InvalidInput, match=f"'{variable.name}' is an output"):
                unit.set(variable.name, np.zeros(variable.shape(unit.mesh)))


@each_unit_with_fields
def test_inputs_are_copied(scene: _Scene, mesh, alive) -> None:
    unit = alive(scene)
    name, value = next(iter(scene.moving.items()))
    given = value(mesh, 0)
    unit.set(name, given)
    kept = unit.get(name).copy()
    given[:] = 0.7
    np.testing.assert_array_equal(unit.get(name), kept)


# --- state ---------------------------------------------------------------------------------------------------------


@each_unit_with_memory
def test_step_of_zero_leaves_units_with_memory_as_they_are(scene: _Scene, alive) -> None:
    # With the inputs of the last step: an output may follow its inputs at once, the memory may not.
    unit = alive(scene)
    _move(scene, unit, 4)
    before = _bits(unit)
    unit.do_step(0.004, 0.0)
    assert _bits(unit) == before


@each_unit
def test_step_of_zero_with_unchanged_inputs_changes_no_output(scene: _Scene, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 4)
    before = _outputs(unit)
    unit.do_step(0.004, 0.0)
    assert _outputs(unit) == before


@each_unit
def test_two_instances_give_the_same_bits(scene: _Scene, alive) -> None:
    first, second = alive(scene), alive(scene)
    for unit in (first, second):
        _move(scene, unit, 5)
    assert _bits(first) == _bits(second)


@each_unit_with_inputs
def test_step_repeated_from_a_saved_state_gives_the_same_bits(scene: _Scene, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 3)
    saved, at_saved = unit.get_state(), _bits(unit)
    _move(scene, unit, 3, first=3)
    forward = _bits(unit)
    assert forward != at_saved
    # A detour with other inputs leaves no trace: nothing outside the saved state remembers.
    _move(scene, unit, 3, first=40)
    unit.set_state(saved)
    assert _bits(unit) == at_saved
    _move(scene, unit, 3, first=3)
    assert _bits(unit) == forward


@each_unit_with_inputs
def test_saved_state_holds_the_inputs_too(scene: _Scene, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 2)
    saved = unit.get_state()
    unit.do_step(0.002, 0.001)
    forward = _bits(unit)
    for name, value in scene.moving.items():
        unit.set(name, value(unit.mesh, 99))
    unit.set_state(saved)
    unit.do_step(0.002, 0.001)
    assert _bits(unit) == forward


@each_unit
def test_serialized_state_goes_on_in_another_instance_to_the_bit(scene: _Scene, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 3)
    data = unit.serialize(unit.get_state())
    assert isinstance(data, bytes)
    other = alive(scene)
    other.set_state(other.deserialize(data))
    assert _bits(other) == _bits(unit)
    for each in (unit, other):
        _move(scene, each, 3, first=3)
    assert _bits(other) == _bits(unit)


@each_unit_with_inputs
def test_saved_state_does_not_change_with_the_unit(scene: _Scene, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 2)
    saved = unit.get_state()
    before = saved.to_bytes()
    _move(scene, unit, 2, first=2)
    unit.reset()
    assert saved.to_bytes() == before


@each_unit_with_inputs
def test_failing_step_leaves_the_unit_as_it_was(scene: _Scene, alive) -> None:
    unit, undisturbed = alive(scene), alive(scene)
    for each in (unit, undisturbed):
        _move(scene, each, 2)
    before = _outputs(unit), {name: value.tobytes() for name, value in unit.get_state().state.items()}
    for name, value in scene.failing.items():
        unit.set(name, value(unit.mesh))
    with np.errstate(all="ignore"), pytest.raises(StepFailure):
        unit.do_step(0.002, 0.001)
    assert (_outputs(unit), {name: value.tobytes() for name, value in unit.get_state().state.items()}) == before
    for each in (unit, undisturbed):
        _move(scene, each, 2, first=2)
    assert _bits(unit) == _bits(undisturbed)


@each_unit
def test_reset_is_the_moment_after_construction(scene: _Scene, alive, started, directions) -> None:
    unit = alive(scene, **{scene.other[0]: scene.other[1]})
    _move(scene, unit, 3)
    unit.reset()
    assert unit.get(scene.other[0]) == scene.kind.variable(scene.other[0]).start
    inputs = {}
    for variable in scene.kind.fields:
        if variable.causality is Causality.INPUT:
            start = np.full(variable.shape(unit.mesh), variable.start)
            np.testing.assert_array_equal(unit.get(variable.name), start)
            if variable.fixed:
                inputs[variable.name] = directions[variable.name]
    unit.instantiate(scene.parameters)
    unit.setup_experiment()
    unit.enter_initialization_mode()
    for name, value in inputs.items():
        unit.set(name, value)
    unit.exit_initialization_mode()
    fresh = alive(scene)
    for each in (unit, fresh):
        _move(scene, each, 2)
    assert _bits(unit) == _bits(fresh)


# --- states in every phase -------------------------------------------------------------------------------------------


def _phases(scene: _Scene, unit: Unit) -> list[Snapshot]:
    """Saved states of an instance with a parameter of its own, one in each phase, the later ones after two steps."""
    other = scene.kind(unit.mesh)
    other.instantiate(scene.parameters | {scene.other[0]: scene.other[1]})
    other.setup_experiment()
    states = [other.get_state()]
    other.enter_initialization_mode()
    for variable in scene.kind.inputs():
        other.set(variable.name, unit.get(variable.name))
    states.append(other.get_state())
    other.exit_initialization_mode()
    _move(scene, other, 2)
    states.append(other.get_state())
    other.terminate()
    return [*states, other.get_state()]


def _to_the_end(scene: _Scene, unit: Unit) -> list[dict[str, bytes]]:
    """What an instance shows on the rest of its way, from whichever phase it is in."""
    shown = []
    if unit.phase is Phase.INSTANTIATED:
        unit.enter_initialization_mode()
    if unit.phase is Phase.INITIALIZATION:
        shown.append(_outputs(unit))
        unit.exit_initialization_mode()
    if unit.phase is Phase.STEPPING:
        shown.append(_outputs(unit))
        _move(scene, unit, 2, first=2)
        unit.terminate()
    return [*shown, _outputs(unit)]


@each_unit
def test_a_state_of_any_phase_is_gone_back_to_from_any_other(scene: _Scene, alive) -> None:
    # FMI allows it (FMI 2.0.4, section 4.2.4); parameters, inputs and the phase itself are then what they were.
    states = _phases(scene, alive(scene))
    assert [state.phase for state in states] == list(Phase)
    reference = scene.kind(alive(scene).mesh)
    ways = []
    for state in states:
        reference.set_state(state)
        ways.append(_to_the_end(scene, reference))
    for start in states:
        for state, way in zip(states, ways, strict=True):
            unit = alive(scene)
            unit.set_state(start)
            unit.set_state(Snapshot.from_bytes(state.to_bytes()))
            assert unit.phase is state.phase
            assert unit.get(scene.other[0]) == scene.other[1]
            assert _to_the_end(scene, unit) == way


@each_unit
def test_a_state_brings_its_parameters_into_an_instance_with_others(scene: _Scene, alive) -> None:
    # A run that went on with the parameters of the instance would look like any other.
    name, value = scene.other
    saver, other, fresh = alive(scene, **{name: value}), alive(scene), scene.kind(alive(scene).mesh)
    for unit in (saver, other):
        _move(scene, unit, 2)
    saved, plain = saver.get_state(), other.get_state()
    for unit in (other, fresh):
        unit.set_state(saved)
        assert unit.get(name) == value
        assert _bits(unit) == _bits(saver)
    for unit in (saver, other, fresh):
        _move(scene, unit, 2, first=2)
        assert _bits(unit) == _bits(saver)
    # And back again.
    undisturbed = alive(scene)
    _move(scene, undisturbed, 4)
    other.set_state(plain)
    assert other.get(name) != value
    _move(scene, other, 2, first=2)
    assert _bits(other) == _bits(undisturbed)


@pytest.mark.parametrize(
    "scene",
    [scene for scene in _SCENES if any(item.fixed for item in scene.kind.inputs()) and scene.moving],
    ids=lambda scene: scene.kind.name,
)
def test_a_state_brings_its_fibres_into_an_instance_with_others(
    scene: _Scene, mesh, directions, alive, started
) -> None:
    names = [item.name for item in scene.kind.inputs() if item.fixed]
    turned = {name: -directions[name][:, [1, 2, 0]] for name in names}
    saver, other = started(scene.kind, mesh, scene.parameters, **turned), alive(scene)
    for unit in (saver, other):
        _move(scene, unit, 2)
    other.set_state(saver.get_state())
    for unit in (saver, other):
        _move(scene, unit, 2, first=2)
    assert _bits(other) == _bits(saver)


@each_unit_with_inputs
def test_a_state_that_nothing_can_be_prepared_from_leaves_everything_as_it_was(
    scene: _Scene, alive, monkeypatch: pytest.MonkeyPatch
) -> None:
    saver, unit, undisturbed = alive(scene, **{scene.other[0]: scene.other[1]}), alive(scene), alive(scene)
    saved = saver.get_state()
    for each in (unit, undisturbed):
        _move(scene, each, 2)
    before, prepare = _bits(unit), unit.prepare

    def failing() -> None:
        # Half of it is there already.
        prepare()
        if unit.get(scene.other[0]) == scene.other[1]:
            raise StepFailure("no memory is left")

    monkeypatch.setattr(unit, "prepare", failing)
    with pytest.raises(StepFailure, match="no memory is left"):
        unit.set_state(saved)
    assert unit.phase is Phase.STEPPING
    assert unit.get(scene.other[0]) != scene.other[1]
    assert _bits(unit) == before
    for each in (unit, undisturbed):
        _move(scene, each, 2, first=2)
    assert _bits(unit) == _bits(undisturbed)


@each_unit
def test_a_state_that_nothing_can_be_prepared_from_leaves_what_is_foreseen(
    scene: _Scene, alive, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved, unit = alive(scene, **{scene.other[0]: scene.other[1]}).get_state(), scene.kind(alive(scene).mesh)
    unit.instantiate(scene.parameters)
    unit.enter_initialization_mode()
    before, prepare = _outputs(unit), unit.prepare

    def failing() -> None:
        prepare()
        if unit.get(scene.other[0]) == scene.other[1]:
            raise StepFailure("no memory is left")

    monkeypatch.setattr(unit, "prepare", failing)
    with pytest.raises(StepFailure):
        unit.set_state(saved)
    assert unit.phase is Phase.INITIALIZATION
    assert _outputs(unit) == before


@each_unit
def test_a_state_that_does_not_fit_is_refused(scene: _Scene, alive) -> None:
    unit = alive(scene)
    _move(scene, unit, 2)
    before, saved = _bits(unit), unit.get_state()

    def shorter(arrays: Any) -> dict[str, np.ndarray]:
        return {name: value[:-1] if value.ndim else np.zeros(2) for name, value in arrays.items()}

    wrong = {
        f"'another' was given to unit '{scene.kind.name}'": [replace(saved, unit="another")],
        "belongs to another mesh": [replace(saved, mesh="another")],
        "state arrays of the state do not fit": [
            replace(saved, state=shorter(saved.state)),
            replace(saved, state={}),
            replace(saved, state=dict(list(saved.state.items())[1:]) | {"another": np.zeros(3)}),
            replace(saved, phase=Phase.INITIALIZATION),
        ],
        "input arrays of the state do not fit": [
            replace(saved, inputs=dict(saved.inputs) | {"another": np.zeros(3)}),
            replace(saved, phase=Phase.INSTANTIATED, inputs={scene.kind.outputs()[0].name: np.zeros(3)}),
        ],
        "parameter '.*' is 'no such'|parameter '.*' is nan": [
            replace(saved, parameters={scene.other[0]: "no such" if isinstance(scene.other[1], str) else np.nan})
        ],
        "has no variable 'no_such'": [replace(saved, parameters={"no_such": 1.0})],
    }
    if saved.inputs:
        wrong["input arrays of the state do not fit"] += [
            replace(saved, inputs={}),
            replace(saved, inputs=shorter(saved.inputs)),
        ]
    if saved.taken is not None:
        wrong["arrays of the last step in the state do not fit"] = [
            replace(saved, taken=replace(saved.taken, before=shorter(saved.taken.before))),
            replace(saved, taken=replace(saved.taken, begin={})),
            replace(saved, taken=replace(saved.taken, inputs=shorter(saved.taken.inputs))),
        ]
    for said, snapshots in wrong.items():
        for snapshot in snapshots:
            with pytest.raises(InvalidInput, match=said):
                unit.set_state(snapshot)
            assert _bits(unit) == before


def test_state_of_another_mesh_with_as_many_nodes_and_elements_is_refused(mesh, alive, directions, started) -> None:
    larger = Mesh(1.1 * mesh.points, mesh.cells, mesh.boundaries)
    other = started(Mechanics, larger, active_stress=np.full(mesh.nodes, 50.0), **directions)
    with pytest.raises(InvalidInput, match="mesh"):
        alive(next(scene for scene in _SCENES if scene.kind is Mechanics)).set_state(other.get_state())


@each_unit
def test_a_state_and_its_bytes_are_the_same(scene: _Scene, alive) -> None:
    unit = alive(scene)
    for phase in _phases(scene, unit):
        again = Snapshot.from_bytes(phase.to_bytes())
        assert (again.unit, again.mesh, again.phase) == (phase.unit, phase.mesh, phase.phase)
        assert again.parameters == phase.parameters
        assert [type(value) for value in again.parameters.values()] == [type(v) for v in phase.parameters.values()]
        assert again.to_bytes() == phase.to_bytes()
        for arrays, own in ((again.inputs, phase.inputs), (again.state, phase.state)):
            assert {name: value.tobytes() for name, value in arrays.items()} == {n: v.tobytes() for n, v in own.items()}
            assert not any(value.flags.writeable for value in arrays.values())


@each_unit
def test_bytes_that_are_no_state_are_refused(scene: _Scene, alive) -> None:
    data = alive(scene).get_state().to_bytes()
    for wrong in (b"", b"no state", data[: len(data) // 2], data[100:]):
        with pytest.raises(InvalidInput, match="not a serialized state"):
            scene.kind.deserialize(wrong)
    # One byte of an array: the archive's own checksum tells.
    wrong = bytearray(data)
    wrong[data.index(b"NUMPY", data.index(b"state/")) + 130] ^= 1
    with pytest.raises(InvalidInput, match="not a serialized state"):
        scene.kind.deserialize(bytes(wrong))


# --- parameters reach the physics ----------------------------------------------------------------------------------


@each_unit
def test_a_parameter_changes_the_result(scene: _Scene, alive) -> None:
    name, value = scene.other
    plain, changed = alive(scene), alive(scene, **{name: value})
    assert plain.get(name) != changed.get(name) == value
    for unit in (plain, changed):
        _move(scene, unit, 3)
    assert _outputs(plain) != _outputs(changed)


def _changed(variable: Any) -> Any:
    if isinstance(variable.start, str):
        return next(choice for choice in variable.choices if choice != variable.start)
    if variable.start == 0.0:
        return 0.3
    return variable.start * 0.9


#: Parameters that need more than a changed number to show, each with what shows it.
_SPECIAL: dict[tuple[str, str], dict[str, Any]] = {
    ("electrophysiology", "refine"): {"refine": 1},
    ("electrophysiology", "stimulus_x_min_mm"): {"stimulus_x_min_mm": 6.0},
    ("electrophysiology", "stimulus_x_max_mm"): {"stimulus_x_max_mm": 7.0},
    ("electrophysiology", "stimulus_half_width_mm"): {"stimulus_half_width_mm": 3.0},
    ("electrophysiology", "stimulus_depth_mm"): {"stimulus_depth_mm": 6.0},
    ("electrophysiology", "activation_potential_mV"): {"activation_potential_mV": -5.0},
    ("electrophysiology", "longest_substep_ms"): {"longest_substep_ms": 0.05},
    ("mechanics", "element_order"): {"element_order": 2},
    ("mechanics", "linear_solver"): {"linear_solver": "multigrid"},
    ("mechanics", "equilibrium_tolerance"): {"equilibrium_tolerance": 1e-3},
    ("eikonal", "stimulus_x_min_mm"): {"stimulus_x_min_mm": 6.0},
    ("eikonal", "stimulus_x_max_mm"): {"stimulus_x_max_mm": 7.0},
    ("eikonal", "stimulus_half_width_mm"): {"stimulus_half_width_mm": 3.0},
    ("eikonal", "stimulus_depth_mm"): {"stimulus_depth_mm": 6.0},
    ("eikonal", "stimulus_potential_mV"): {"stimulus_potential_mV": -79.5},
    # The default probes lie outside of the small mesh, which they are to leave for another of its places.
    **{
        (unit, name): {name: -7.0}
        for unit in ("electrophysiology", "eikonal")
        for name in (f"probe_{number}_{axis}_mm" for number in (1, 2, 3) for axis in "xz")
    },
}

#: What has to be chosen for the parameters of an ionic model, or of a passive law, to matter.
_CHOSEN = {
    ("electrophysiology", variable.name): {"ionic_model": name, "longest_substep_ms": 0.15}
    for name, model in IONIC_MODELS.items()
    for variable in parameters_of(model)
} | {
    (unit, variable.name): {"material": material}
    for unit in ("mechanics", "local_mechanics")
    for material, laws in MATERIALS.items()
    for law in laws
    for variable in parameters_of(law)
}
# The gate opens in cells that have come back to rest.
_CHOSEN["electrophysiology", "gate_opening_time_ms"] |= {"outward_time_ms": 0.6, "gate_closing_time_ms": 2.0}


#: Parameters that do not act here: of what stands behind what does not fail, which test_solvers.py shows to act, of
#: shear along the fibre where an element is stretched along its axes only, and of what is refused, which
#: test_explicit_diffusion_step.py shows.
_ELSEWHERE = {
    ("mechanics", "newton_iterations"),
    ("local_mechanics", "guccione_shear"),
    ("electrophysiology", "explicit_limit"),
}


@pytest.mark.parametrize(
    ("scene", "variable"),
    [
        pytest.param(scene, variable, id=f"{scene.kind.name}-{variable.name}")
        for scene in _SCENES
        for variable in scene.kind.variables()
        if variable.causality is Causality.PARAMETER and (scene.kind.name, variable.name) not in _ELSEWHERE
    ],
)
def test_every_parameter_reaches_the_physics(scene: _Scene, variable: Any, alive) -> None:
    """A parameter is shown to act when it changes an output, or turns the unit into one that fails."""
    chosen = _CHOSEN.get((scene.kind.name, variable.name), {})
    changes = _SPECIAL.get((scene.kind.name, variable.name), {variable.name: _changed(variable)})

    def course(**parameters: Any) -> list[dict[str, bytes]] | str:
        try:
            unit = alive(scene, **parameters)
            seen = []
            for number in range(8):
                _move(scene, unit, 1, first=number)
                seen.append(_outputs(unit))
        except StepFailure as failure:
            return str(failure)
        return seen

    assert course(**chosen, **changes) != course(**chosen)


# --- parameters far from their defaults ------------------------------------------------------------------------------


class _Broken(FiberGenerator):
    """A unit whose physics fails with a given exception."""

    error: Exception = StepFailure("no equilibrium")

    def initial(self, inputs: Any) -> dict[str, np.ndarray]:
        raise self.error


def _told(error: Exception, parameters: dict[str, float], mesh: Mesh) -> str:
    unit = _Broken(mesh)
    unit.error = error
    unit.instantiate(parameters)
    unit.setup_experiment()
    unit.enter_initialization_mode()
    with pytest.raises((InvalidInput, StepFailure)) as caught:
        unit.exit_initialization_mode()
    if not isinstance(error, (InvalidInput, StepFailure)):
        assert isinstance(caught.value, StepFailure)
    return str(caught.value)


def test_what_fails_names_the_parameters_that_are_far_from_their_defaults(small_heart: Mesh) -> None:
    # A person could look for the reason in the mesh, or in another parameter.
    far = {"endocardial_angle_deg": 6e10, "epicardial_angle_deg": 59.0, "apex_z_mm": -71.0}
    for error in (StepFailure("no equilibrium"), InvalidInput("no equilibrium")):
        message = _told(error, far, small_heart)
        assert message == (
            "no equilibrium. Far from their defaults are: endocardial_angle_deg = 6e+10, epicardial_angle_deg = 59"
        )
        assert _told(error, {"apex_z_mm": -71.0}, small_heart) == "no equilibrium"


def test_numbers_that_nothing_can_be_computed_with_are_a_failed_step(small_heart: Mesh) -> None:
    # A parameter of 1e308 could end in a traceback; without one, a division by zero is a bug and has to look like it.
    far = {"endocardial_angle_deg": 1e308}
    for error in (np.linalg.LinAlgError("singular"), OverflowError("too large"), ZeroDivisionError(), MemoryError()):
        message = _told(error, far, small_heart)
        assert message.startswith("the computation cannot continue (")
        assert "endocardial_angle_deg = 1e+308" in message
    with pytest.raises(ZeroDivisionError):
        _told(ZeroDivisionError(), {}, small_heart)


def test_outputs_that_are_not_finite_do_not_get_out(small_heart: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    # A state may be finite and what is shown of it not: infinity would go on to the next unit.
    unit = FiberGenerator(small_heart)
    unit.instantiate({})
    unit.setup_experiment()
    unit.enter_initialization_mode()
    unit.exit_initialization_mode()
    monkeypatch.setattr(unit, "output", lambda name, state: 1e300 * 1e300 * state[name])
    with pytest.raises(StepFailure, match="'fiber' is not finite"):
        unit.get("fiber")
