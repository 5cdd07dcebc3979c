"""If these fail, a person sees fibres that run another way than the mechanics pulls."""

from pathlib import Path

import numpy as np
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.fiber_layout import fiber_layout, fiber_lines, helix_angle
from cardiac_cosim.report.figures.skin import Skin
from cardiac_cosim.report.figures.transmural_directions import transmural_directions, within_wall
from cardiac_cosim.report.figures.wall_layers import depths, layers_of_the_wall
from cardiac_cosim.units.geometry.grid import slab
from stored_body import drawn, stored, titles


def test_helix_angle_has_the_sign_of_the_climb_around_the_wall() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 7)[:-1, None]
    outward = np.hstack([np.cos(turns), np.sin(turns), 0.0 * turns])
    counterclockwise = np.hstack([-np.sin(turns), np.cos(turns), 0.0 * turns])
    for degrees in (-60.0, 0.0, 35.0, 60.0):
        slope = np.deg2rad(degrees)
        fiber = np.cos(slope) * counterclockwise + np.sin(slope) * np.array([0.0, 0.0, 1.0])
        np.testing.assert_allclose(helix_angle(fiber, outward), degrees, atol=1e-10)
        np.testing.assert_allclose(helix_angle(-fiber, outward), degrees, atol=1e-10)


def test_helix_angle_is_measured_within_a_slanted_wall() -> None:
    outward = np.array([[0.8, 0.0, -0.6]])
    upward, around = np.array([[0.6, 0.0, 0.8]]), np.array([[0.0, 1.0, 0.0]])
    fiber = np.cos(0.5) * around + np.sin(0.5) * upward
    np.testing.assert_allclose(helix_angle(fiber, outward), np.rad2deg(0.5))


def test_helix_angle_is_zero_where_the_wall_is_horizontal() -> None:
    assert helix_angle(np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, -1.0]])).tolist() == [0.0]


def test_fiber_lines_follow_the_field_within_the_surface() -> None:
    square = np.array([[0, 0, 0], [30, 0, 0], [30, 30, 0], [0, 30, 0]], dtype=float)
    corners = np.array([square[[0, 1, 2]], square[[0, 2, 3]]])
    # The part of a fibre out of the surface does not count.
    lines, face = fiber_lines(corners, np.array([[1.0, 0.0, 0.4], [-1.0, 0.0, 0.0]]), spacing_mm=5.0, length_mm=4.0)
    assert face.tolist() == [0, 1]
    np.testing.assert_allclose(lines.mean(axis=1), corners.mean(axis=1))
    np.testing.assert_allclose(np.ptp(lines[..., 1:], axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(lines[..., 0], axis=1), 4.0)
    lines, _ = fiber_lines(corners, np.tile([1.0, 0.0, 0.0], (2, 1)), spacing_mm=15.0, length_mm=4.0)
    assert len(lines) == 1


def _slab(folder: Path, *, boundaries: bool = True) -> StoredRun:
    """A piece of wall whose fibres turn from 60 degrees at y = −6 mm to −60 degrees at y = 6 mm."""
    mesh = slab(3.0)
    angle = np.deg2rad(-10.0 * mesh.points[mesh.cells].mean(axis=1)[:, 1])
    sheet = np.tile([0.0, 1.0, 0.0], (mesh.elements, 1))
    # Around the wall, counterclockwise from above with the outside at y = 6 mm, is towards −X.
    fiber = np.column_stack([-np.cos(angle), np.zeros(mesh.elements), np.sin(angle)])
    fixed = {"fiber": fiber, "sheet": sheet}
    return stored(folder, mesh.points, mesh.cells, fixed=fixed, boundaries=mesh.boundaries if boundaries else None)


def test_depth_is_counted_from_the_outer_surface() -> None:
    mesh = slab(3.0)
    depth = depths(mesh.points, mesh.boundaries["endocardium"], mesh.boundaries["epicardium"])
    np.testing.assert_allclose(depth, (6.0 - mesh.points[:, 1]) / 12.0, atol=1e-12)


def test_fibres_are_shown_at_three_depths_and_turn_through_the_wall(tmp_path: Path) -> None:
    run = _slab(tmp_path)
    mesh, fiber, sheet = run.mesh, run.initial("fiber"), run.initial("sheet")
    assert mesh is not None
    assert fiber is not None
    assert sheet is not None
    angle = helix_angle(fiber, sheet)
    inner, outer = run.boundaries["endocardium"], run.boundaries["epicardium"]
    layers = layers_of_the_wall(Skin(mesh), sheet, angle, inner, outer)
    # Elements are 3 mm deep: those at a surface have their centres up to 2.25 mm below it, and a node at an edge of
    # the mesh may have more of them on one side.
    for name, y, degrees, off in (
        ("epicardium", 6.0, -60, 22.5),
        ("mid-wall", 0.0, 0, 10.0),
        ("endocardium", -6.0, 60, 22.5),
    ):
        layer = layers[name]
        np.testing.assert_allclose(layer.corners[..., 1], y, atol=1e-9)
        assert (layer.face_normals[:, 1] > 0.99).all(), "all are seen from the outer side"
        assert np.abs(layer.angle - degrees).max() < off
        # What is drawn as a line is the direction that the colour says.
        outward = np.tile([0.0, 1.0, 0.0], (len(layer.fiber), 1))
        np.testing.assert_allclose(helix_angle(layer.fiber, outward), layer.angle.mean(axis=1))
    assert titles(drawn(fiber_layout(run)))[:3] == ["epicardium", "mid-wall", "endocardium"]


def test_without_named_boundaries_the_skin_is_shown(tmp_path: Path) -> None:
    assert titles(drawn(fiber_layout(_slab(tmp_path, boundaries=False)))) == [
        "from outside",
        "cut lengthwise",
        "upper part cut away",
    ]


def test_the_coordinate_system_of_the_wall_is_orthonormal() -> None:
    sheet = np.array([[0.6, 0.0, -0.8], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    along, around = within_wall(sheet)
    np.testing.assert_allclose(along[:2], [[0.8, 0.0, 0.6], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(around[:2], np.cross(sheet, along)[:2])
    # In a horizontal wall nothing leads to the base.
    assert not along[2].any()


def test_a_section_leads_through_the_wall(tmp_path: Path) -> None:
    figure = drawn(transmural_directions(_slab(tmp_path)))
    assert titles(figure) == ["long-axis section", "short-axis section, from above"]
    # Seen from X, the direction through the wall lies in the picture, and so does the one to the base.
    (through, along), _ = ([arrows for arrows in axis.collections if hasattr(arrows, "U")] for axis in figure.axes)
    assert (np.abs(through.U) > 1.0).all()
    np.testing.assert_allclose(through.V, 0.0, atol=1e-9)
    assert (along.V > 1.0).all()
