"""If these fail, electrophysiology on a finer mesh inside solves another problem than on that mesh itself."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.refinement import refined

_STIMULUS = {"stimulus_x_min_mm": -1.0, "stimulus_x_max_mm": 8.0, "time_scale_reduction": 0.0}


@pytest.mark.parametrize(("name", "size"), [("strand", 5.0), ("sheet", 10.0), ("slab", 6.0)])
@pytest.mark.parametrize("levels", [1, 2])
def test_every_part_lies_in_its_parent_and_all_parts_are_equal(name: str, size: float, levels: int) -> None:
    mesh = build(name, size)
    inner = refined(mesh, levels)
    assert np.array_equal(inner.mesh.points[: mesh.nodes], mesh.points)
    parts = 2 ** (mesh.dimension * levels)
    assert np.array_equal(np.bincount(inner.parents), np.full(mesh.elements, parts))
    np.testing.assert_allclose(inner.mesh.volumes, mesh.volumes[inner.parents] / parts, rtol=1e-11)
    axes = slice(mesh.dimension)
    corners = mesh.points[mesh.cells]
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1])[:, :, axes])[inner.parents]
    offset = (inner.mesh.centroids - corners[inner.parents, 0])[:, axes]
    weights = np.einsum("ei,eij->ej", offset, inverse)
    assert weights.min() > 0.0
    assert weights.sum(axis=1).max() < 1.0


def test_no_levels_and_single_points_are_the_mesh_itself(small_heart: Mesh) -> None:
    assert refined(small_heart, 0).mesh is small_heart
    cell = build("cell", 1.0)
    assert refined(cell, 3).mesh is cell


@pytest.mark.parametrize(("name", "size"), [("strand", 4.0), ("slab", 6.0)])
def test_refined_inside_is_solved_on_the_refined_mesh(name: str, size: float, started: Any) -> None:
    mesh = build(name, size)
    inner = refined(mesh, 2)
    generator = started(FiberGenerator, mesh)
    random = np.random.default_rng(1)
    stretch = 1.0 + 0.05 * random.random(mesh.elements)
    parameters = _STIMULUS | {"stimulus_x_max_mm": 5.0}
    inside = started(Electrophysiology, mesh, parameters | {"refine": 2}, fiber=generator.get("fiber"), stretch=stretch)
    outside = started(
        Electrophysiology,
        inner.mesh,
        parameters,
        fiber=generator.get("fiber")[inner.parents],
        stretch=stretch[inner.parents],
    )
    for number in range(4):
        for unit in (inside, outside):
            unit.do_step(5e-3 * number, 5e-3)
    for output in ("potential", "activation_time"):
        assert inside.get(output).shape == (mesh.nodes,)
        np.testing.assert_allclose(inside.get(output), outside.get(output)[: mesh.nodes], rtol=1e-12)


def test_speed_converges_with_the_levels_at_second_order(started: Any) -> None:
    mesh = build("strand", 2.0)
    fiber = started(FiberGenerator, mesh).get("fiber")

    def took(levels: int) -> float:
        parameters = _STIMULUS | {"refine": levels, "stretch_conductance": 0.0, "longest_substep_ms": 0.05}
        unit = started(Electrophysiology, mesh, parameters, fiber=fiber)
        unit.do_step(0.0, 0.09)
        times = unit.get("activation_time")
        return float(times[20] - times[10])

    errors = [abs(took(levels) - took(4)) for levels in (0, 1, 2)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)
