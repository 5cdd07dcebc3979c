"""If these fail, the curve that a tool plots of a field is not that of its mean or maximum."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.arrays import FloatArray
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import LocalMechanics, Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.snapshot import State
from cardiac_cosim.units.statistics import Statistic
from cardiac_cosim.units.unit import FALLBACKS, IMPLEMENTATION, Unit
from cardiac_cosim.units.variable import Causality, Location, Record

#: What moves on the mesh in each unit, written out once by hand.
_MOVING = {
    "fiber_generator": [],
    "electrophysiology": ["potential", "activation_time"],
    "eikonal": ["potential", "activation_time"],
    "active_stress": ["active_stress", "active_stiffness", "reference_stretch"],
    "mechanics": ["stretch", "displacement"],
    "local_mechanics": ["stretch", "displacement"],
    "mass": [],
    "response": [],
}


@pytest.mark.parametrize("name", UNITS)
def test_every_field_that_moves_has_a_mean_and_a_maximum_behind_all_fields(name: str) -> None:
    kind = UNITS[name]
    expected = [f"{field}_{end}" for field in _MOVING[name] for end in ("mean", "max")]
    behind = [variable.name for variable in kind.variables() if variable not in (IMPLEMENTATION, FALLBACKS)]
    assert behind[-len(expected) or len(behind) :] == expected
    assert [variable.name for variable in kind.outputs() if isinstance(variable, Statistic)] == expected
    for each in expected:
        field, number = kind.variable(each.rpartition("_")[0]), kind.variable(each)
        assert (number.causality, number.location, number.components) == (Causality.OUTPUT, Location.GLOBAL, 1)
        assert (number.unit, number.depends_on) == (field.unit, field.depends_on)
        # The mean over all nodes follows the inputs everywhere.
        assert not number.pointwise
        assert number.record is (Record.VALUE if each == "active_stress_mean" else Record.NOTHING)


def _beating(started: Any, mesh: Mesh) -> list[Unit]:
    """Units in the middle of something, such that no field is the same everywhere."""
    directions = started(FiberGenerator, mesh)
    fiber, sheet = directions.get("fiber"), directions.get("sheet")
    potential = -80.0 + 5.0 * np.abs(mesh.points[:, 0] + 0.3 * mesh.points[:, 2])
    stretch = 1.0 + 1e-3 * mesh.centroids[:, 1]
    tension = started(ActiveStress, mesh, {"length_dependence": 0.5}, potential=potential, stretch=stretch)
    tension.do_step(0.0, 0.005)
    wall = started(Mechanics, mesh, fiber=fiber, sheet=sheet, active_stress=tension.get("active_stress"))
    pointwise = started(LocalMechanics, mesh, fiber=fiber, sheet=sheet, active_stress=tension.get("active_stress"))
    wave = started(Electrophysiology, mesh, fiber=fiber)
    wave.do_step(0.0, 0.01)
    return [tension, wall, pointwise, wave]


def test_the_numbers_are_those_of_the_fields(started: Any, two_chambers: Mesh) -> None:
    seen = set()
    for unit in _beating(started, two_chambers):
        for field in _MOVING[unit.name]:
            values = unit.get(field)
            if values.ndim == 2:
                values = np.sqrt((values**2).sum(axis=1))
            if field == "activation_time":
                assert 0 < np.count_nonzero(values >= 0.0) < len(values)
                values = values[values >= 0.0]
            mean, largest = unit.get(f"{field}_mean"), unit.get(f"{field}_max")
            assert mean.shape == largest.shape == ()
            assert float(mean) == pytest.approx(sum(values.tolist()) / len(values), rel=1e-13)
            assert float(largest) == max(values.tolist())
            seen.add((unit.name, field, float(mean) != float(largest)))
    # They differ, but where nothing is displaced.
    assert {(name, field) for name, field, differ in seen if not differ} == {("local_mechanics", "displacement")}
    assert len(seen) == 9


def test_vectors_are_not_measured_by_their_components(started: Any, two_chambers: Mesh) -> None:
    _, wall, *_ = _beating(started, two_chambers)
    # Through the wall everything moves down or inwards: components cancel, magnitudes do not.
    assert float(wall.get("displacement_max")) > np.abs(wall.get("displacement")).max()
    assert float(wall.get("displacement_mean")) > np.abs(wall.get("displacement").mean(axis=0)).max()


def test_before_the_wave_comes_there_is_no_activation_time_to_average(started: Any) -> None:
    mesh = build("strand", 2.0)
    fiber = started(FiberGenerator, mesh).get("fiber")
    ahead = {"stimulus_potential_mV": -60.0, "stimulus_x_max_mm": 8.0, "stretch_conductance": 0.0}
    waiting = started(Electrophysiology, mesh, ahead, fiber=fiber)
    assert (waiting.get("activation_time") == -1.0).all()
    assert float(waiting.get("activation_time_mean")) == float(waiting.get("activation_time_max")) == -1.0
    # Stimulated nodes are activated at 0 ms, the others not: one of either kind would pull the mean away.
    begun = started(Electrophysiology, mesh, ahead | {"stimulus_potential_mV": -10.0}, fiber=fiber)
    assert set(begun.get("activation_time").tolist()) == {-1.0, 0.0}
    assert float(begun.get("activation_time_mean")) == float(begun.get("activation_time_max")) == 0.0


def test_rollback_takes_the_numbers_along(started: Any, two_chambers: Mesh) -> None:
    *_, wave = _beating(started, two_chambers)
    names = [variable.name for variable in wave.outputs() if variable.location is Location.GLOBAL]
    assert len(names) == 7
    saved, before = wave.get_state(), {name: float(wave.get(name)) for name in names}
    wave.do_step(0.01, 0.01)
    assert all(float(wave.get(name)) != before[name] for name in names)
    wave.set_state(saved)
    assert {name: float(wave.get(name)) for name in names} == before


def test_who_does_not_read_them_does_not_pay(started: Any, two_chambers: Mesh) -> None:
    class Counting(ActiveStress):
        asked = 0

        def output(self, name: str, state: State) -> FloatArray:
            Counting.asked += 1
            return super().output(name, state)

    unit = started(Counting, two_chambers)
    for number in range(3):
        unit.do_step(1e-3 * number, 1e-3)
    assert Counting.asked == 0
    unit.get("active_stress_mean")
    assert Counting.asked == 1


@pytest.mark.parametrize(
    ("unit", "name"),
    [("electrophysiology", "activation_time"), ("active_stress", "active_stress"), ("mechanics", "displacement")],
)
def test_gradients_are_those_of_differences_and_places_without_a_value_have_none(unit: str, name: str) -> None:
    random = np.random.default_rng(5)
    field = UNITS[unit].variable(name)
    values = random.uniform(1.0, 2.0, (9, 3) if field.components == 3 else 9)
    if field.missing is not None:
        values[::2] = field.missing
    change = random.uniform(-1.0, 1.0, values.shape)
    for end in ("mean", "max"):
        statistic = UNITS[unit].variable(f"{name}_{end}")
        assert isinstance(statistic, Statistic)
        gradient = statistic.gradient(values)
        assert gradient.shape == values.shape
        if field.missing is not None:
            assert not gradient[::2].any()
            change[::2] = 0.0
            np.testing.assert_array_equal(statistic.gradient(np.full(9, field.missing)), 0.0)
        difference = (statistic(values + 1e-6 * change) - statistic(values - 1e-6 * change)) / 2e-6
        assert np.sum(gradient * change) == pytest.approx(float(difference), rel=1e-6)


def test_where_nothing_is_displaced_the_mean_displacement_does_not_change() -> None:
    # At rest it has a kink; its differences to both sides cancel.
    statistic = Mechanics.variable("displacement_mean")
    assert isinstance(statistic, Statistic)
    np.testing.assert_array_equal(statistic.gradient(np.zeros((4, 3))), 0.0)
