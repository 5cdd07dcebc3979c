"""If these fail, the potential that a tool plots is not that of the place in the heart where the probe was put."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.eikonal import Eikonal
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.unit import Unit

each_unit = pytest.mark.parametrize("kind", [Electrophysiology, Eikonal], ids=lambda kind: kind.name)

#: The model's three points in mm.
_HEART = [[25.0, 0.0, -1.0], [20.0, 0.0, -40.0], [0.0, 0.0, -60.0]]


def _parameters(points: Any) -> dict[str, float]:
    return {
        f"probe_{number}_{axis}_mm": float(value)
        for number, point in enumerate(points, start=1)
        for axis, value in zip("xyz", point, strict=True)
    }


def _shown(unit: Unit) -> list[float]:
    return [float(unit.get(f"potential_probe_{number}")) for number in (1, 2, 3)]


def test_the_defaults_are_the_three_points_of_the_model() -> None:
    for kind in (Electrophysiology, Eikonal):
        expected = _parameters(_HEART)
        assert {name: kind.variable(name).start for name in expected} == expected


@each_unit
def test_between_the_nodes_of_an_element_the_potential_is_linear(
    kind: type[Unit], started: Any, two_chambers: Mesh
) -> None:
    fiber = started(FiberGenerator, two_chambers).get("fiber")
    weights, elements = np.array([0.1, 0.2, 0.3, 0.4]), two_chambers.cells[[3, 171, 402]]
    unit = started(kind, two_chambers, _parameters(weights @ two_chambers.points[elements]), fiber=fiber)
    for number in range(3):
        np.testing.assert_allclose(_shown(unit), unit.get("potential")[elements] @ weights, rtol=0, atol=1e-9)
        unit.do_step(0.005 * number, 0.005)
    assert np.ptp(unit.get("potential")[elements]) > 1.0


@each_unit
def test_a_probe_outside_shows_the_nearest_place_of_a_small_scene(kind: type[Unit], started: Any) -> None:
    for geometry in ("cell", "strand", "sheet", "slab"):
        mesh = build(geometry, 5.0)
        fiber = started(FiberGenerator, mesh).get("fiber")
        unit = started(kind, mesh, {"stimulus_x_max_mm": 12.0, "stimulus_x_min_mm": -1.0}, fiber=fiber)
        unit.do_step(0.0, 0.004)
        potential = unit.get("potential")
        for shown, point in zip(_shown(unit), _HEART, strict=True):
            # These scenes are boxes along the axes: their nearest place is known, and lies between nodes around it.
            place = np.clip(point, mesh.points.min(axis=0), mesh.points.max(axis=0))
            around = potential[np.linalg.norm(mesh.points - place, axis=1) <= 5.0 * np.sqrt(3.0)]
            assert around.min() - 1e-9 <= shown <= around.max() + 1e-9, geometry


def test_a_refined_unit_shows_the_potential_of_the_scenes_mesh(started: Any, two_chambers: Mesh) -> None:
    fiber = started(FiberGenerator, two_chambers).get("fiber")
    nodes = [5, 40, 90]
    unit = started(
        Electrophysiology, two_chambers, {"refine": 1} | _parameters(two_chambers.points[nodes]), fiber=fiber
    )
    unit.do_step(0.0, 0.003)
    np.testing.assert_allclose(_shown(unit), unit.get("potential")[nodes], rtol=0, atol=1e-9)


@each_unit
def test_a_probe_that_is_nowhere_is_refused_by_name(kind: type[Unit], started: Any, two_chambers: Mesh) -> None:
    fiber = started(FiberGenerator, two_chambers).get("fiber")
    with pytest.raises(InvalidInput, match=r"'probe_1_x_mm' to 'probe_3_z_mm': the point \[20.0, -1e\+200, -40.0\]"):
        started(kind, two_chambers, {"probe_2_y_mm": -1e200}, fiber=fiber)
