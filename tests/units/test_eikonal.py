"""If these fail, arrival times are not those of the wave, or the pulse behind it is not the cell's."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.eikonal import Eikonal
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.arrival_times import arrival_times

_UNIFORM = {"time_scale_reduction": 0.0, "stimulus_x_min_mm": -1.0, "stimulus_x_max_mm": 8.0}


@pytest.mark.parametrize(
    ("name", "sizes"), [("strand", (6.0, 3.0)), ("sheet", (6.0, 3.0, 1.5)), ("slab", (6.0, 3.0, 1.5))]
)
def test_a_point_source_arrives_at_the_distance_with_first_order(name: str, sizes: tuple[float, ...]) -> None:
    errors = []
    for size in sizes:
        mesh = build(name, size)
        # Stretched space: a unit step along x takes twice as long as along y and z.
        metric = np.tile(np.diag([4.0, 1.0, 1.0]), (mesh.elements, 1, 1))
        distance = np.linalg.norm((mesh.points - mesh.points[0]) * [2.0, 1.0, 1.0], axis=1)
        # Released in a ball, where the distance has no kink.
        start = np.where(distance <= 12.0, distance, np.inf)
        found = arrival_times(mesh, metric, start)
        assert (found >= distance - 1e-9).all()
        errors.append((found - distance).max() / distance.max())
    if name == "strand":
        assert max(errors) < 1e-12
    else:
        assert (np.log2(np.array(errors[:-1]) / np.array(errors[1:])) > 0.6).all(), errors
        assert errors[-1] < 0.02


def test_a_plane_wave_is_exact_on_any_elements(small_heart: Mesh) -> None:
    metric = np.tile(0.25 * np.eye(3), (small_heart.elements, 1, 1))
    height = small_heart.points[:, 2].max() - small_heart.points[:, 2]
    start = np.where(height < 15.0, 0.5 * height, np.inf)
    found = arrival_times(small_heart, metric, start)
    # Never too early; where elements are obtuse or the wall turns away from the wave, later.
    assert (found >= 0.5 * height - 1e-9).all()
    assert np.isfinite(found).all()


def test_nothing_arrives_where_nothing_was_released(small_heart: Mesh) -> None:
    metric = np.tile(np.eye(3), (small_heart.elements, 1, 1))
    assert np.isinf(arrival_times(small_heart, metric, np.full(small_heart.nodes, np.inf))).all()


def test_wave_and_pulse_are_those_of_the_monodomain_on_a_fine_strand(started: Any) -> None:
    mesh = build("strand", 0.5)
    fiber = started(FiberGenerator, mesh).get("fiber")
    eikonal = started(Eikonal, mesh, _UNIFORM, fiber=fiber)
    quiet = _UNIFORM | {"stretch_conductance": 0.0, "longest_substep_ms": 0.05}
    monodomain = started(Electrophysiology, mesh, quiet, fiber=fiber)
    for unit in (eikonal, monodomain):
        unit.do_step(0.0, 0.08)
    near, far = 40, 80
    took = [unit.get("activation_time")[far] - unit.get("activation_time")[near] for unit in (eikonal, monodomain)]
    assert took[0] == pytest.approx(took[1], rel=0.005)
    # The pulses, each from its own activation on: the monodomain's wave takes some milliseconds to form.
    late = eikonal.get("activation_time")[far] - monodomain.get("activation_time")[far]
    assert -8.0 < late < 0.0
    for unit, moment in ((eikonal, 0.3 + 1e-3 * late), (monodomain, 0.3)):
        unit.do_step(0.08, moment - 0.08)
    assert eikonal.get("potential")[far] == pytest.approx(monodomain.get("potential")[far], abs=0.5)


def test_the_step_does_not_matter_and_the_wave_is_nowhere_before_it_arrives(started: Any) -> None:
    mesh = build("strand", 2.0)
    fiber = started(FiberGenerator, mesh).get("fiber")
    one, many = (started(Eikonal, mesh, _UNIFORM, fiber=fiber) for _ in range(2))
    one.do_step(0.0, 0.05)
    for number in range(50):
        many.do_step(1e-3 * number, 1e-3)
    np.testing.assert_allclose(one.get("potential"), many.get("potential"), atol=1e-9)
    waiting = one.get("activation_time") < 0.0
    assert waiting.any()
    assert (one.get("potential")[waiting] < -20.0).all()
    assert (one.get("potential")[~waiting] >= -20.0 - 1e-9).all()


def test_a_stimulus_below_the_threshold_starts_no_wave(started: Any) -> None:
    mesh = build("strand", 2.0)
    fiber = started(FiberGenerator, mesh).get("fiber")
    unit = started(Eikonal, mesh, _UNIFORM | {"stimulus_potential_mV": -79.5}, fiber=fiber)
    unit.do_step(0.0, 0.2)
    assert (unit.get("activation_time") == -1.0).all()
    np.testing.assert_allclose(unit.get("potential"), -80.0)


def test_it_gives_what_the_monodomain_gives() -> None:
    outputs = [[item.name for item in kind.outputs()] for kind in (Eikonal, Electrophysiology)]
    assert outputs[0] == outputs[1]
