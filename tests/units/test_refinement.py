"""If these fail, a refined mesh is another body than the coarse one, or fields on it solve another problem."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.refinement import check_levels, refined
from cardiac_cosim.units.mesh.transmural import wall_distance

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


def _areas(mesh: Mesh, name: str) -> np.ndarray:
    """Outward normals as long as their faces are large, shape (faces, 3); of edges of triangles only that size."""
    corners = mesh.points[mesh.boundaries[name]]
    if mesh.dimension == 3:
        return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1))[:, None]


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("name", ["small_heart", "sheet"])
def test_volume_and_boundaries_of_a_refined_mesh_are_those_of_the_coarse_one(
    name: str, levels: int, small_heart: Mesh
) -> None:
    mesh = small_heart if name == "small_heart" else build(name, 10.0)
    fine = refined(mesh, levels).mesh
    assert fine.elements == mesh.elements * 2 ** (mesh.dimension * levels)
    assert fine.volumes.sum() == pytest.approx(mesh.volumes.sum(), rel=1e-13)
    assert list(fine.boundaries) == list(mesh.boundaries)
    parts = 2 ** ((mesh.dimension - 1) * levels)
    on_surface = {tuple(sorted(face)) for face in fine.surface.tolist()}
    for boundary, faces in mesh.boundaries.items():
        assert {tuple(sorted(face)) for face in fine.boundaries[boundary].tolist()} <= on_surface
        # The parts of each face stand where it stood, and point where it pointed.
        whole = _areas(mesh, boundary)
        cut = _areas(fine, boundary).reshape(len(faces), parts, -1)
        np.testing.assert_allclose(cut, np.repeat(whole[:, None] / parts, parts, axis=1), rtol=0, atol=1e-12)
        corners = fine.points[fine.boundaries[boundary]]
        centres = corners.mean(axis=1).reshape(len(faces), parts, 3).mean(axis=1)
        np.testing.assert_allclose(centres, mesh.points[faces].mean(axis=1), atol=1e-12)
    # Where the coarse boundaries are all of the surface, the fine ones are.
    sizes = [sum(map(len, each.boundaries.values())) for each in (mesh, fine)]
    assert (sizes[0] == len(mesh.surface)) == (sizes[1] == len(fine.surface))


def test_the_ends_of_a_refined_strand_are_its_ends_and_what_was_told_of_a_mesh_is_told_again() -> None:
    mesh = build("strand", 5.0)
    told = Mesh(mesh.points, mesh.cells, mesh.boundaries, ("a node was left out",))
    fine = refined(told, 3).mesh
    assert fine.notes == told.notes
    for name, ends in mesh.boundaries.items():
        assert np.array_equal(fine.boundaries[name], ends)


def test_the_place_in_the_wall_is_measured_from_the_same_surfaces(small_heart: Mesh) -> None:
    fine = refined(small_heart, 1).mesh
    for side in (("lv_endocardium", "rv_endocardium"), ("epicardium", "rv_septum")):
        distance = wall_distance(fine.centroids, fine, side)
        np.testing.assert_allclose(distance, wall_distance(fine.centroids, small_heart, side), atol=1e-12)


def test_the_two_sides_of_a_tear_stay_two_boundaries(box: Any) -> None:
    # They lie at the same place, where only the nodes' numbers tell them apart.
    whole = box([0, 1, 2], [0, 1, 2], [0, 1, 2])
    torn = np.flatnonzero((whole.points[:, 0] == 1.0) & (whole.points[:, 2] == 2.0))
    number = np.arange(whole.nodes)
    number[torn] = whole.nodes + np.arange(len(torn))
    right = whole.centroids[:, 0] > 1.0
    points = np.vstack([whole.points, whole.points[torn]])
    cells = np.where(right[:, None], number[whole.cells], whole.cells)
    surface = Mesh(points, cells).surface
    lips = surface[(points[surface][:, :, 0] == 1.0).all(axis=1)]
    on_right = (lips >= whole.nodes).any(axis=1)
    mesh = Mesh(points, cells, {"left": lips[~on_right], "right": lips[on_right]})
    inner = refined(mesh, 2)
    fine = inner.mesh
    for name, side in (("left", ~right), ("right", right)):
        assert len(mesh.boundaries[name]) == 4
        assert len(fine.boundaries[name]) == 4 * 16
        own = {
            tuple(sorted(corners))
            for cell in fine.cells[side[inner.parents]].tolist()
            for corners in (cell[1:], cell[:1] + cell[2:], cell[:2] + cell[3:], cell[:3])
        }
        assert {tuple(sorted(face)) for face in fine.boundaries[name].tolist()} <= own


def test_more_elements_than_a_computer_holds_are_refused_before_they_are_made(small_heart: Mesh) -> None:
    check_levels(small_heart, 4, "it")
    for levels in (5, 30, 10**300):
        with pytest.raises(
            InvalidInput, match=f"^it is {levels}, which makes .* of {small_heart.elements}; .* take fewer levels"
        ):
            check_levels(small_heart, levels, "it")
    check_levels(build("cell", 1.0), 10**300, "it")


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
