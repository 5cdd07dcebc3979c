"""If these fail, a body in space is drawn with other shapes, places or colours than it has."""

import numpy as np
import pytest
from cardiac_cosim.report.figures.scene import View, shaded, strokes
from cardiac_cosim.report.figures.surface import divided, normals, section, sharp_edges, smoothing, surface
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from stored_body import CUBE_CELLS, CUBE_POINTS

_GREY = ScalarMappable(Normalize(0.0, 10.0), "gray")


def test_only_faces_that_face_the_eye_are_drawn_and_only_up_to_the_cut() -> None:
    faces, _ = surface(CUBE_CELLS)
    corner_normals = np.repeat(normals(CUBE_POINTS, faces)[:, None], 3, axis=1)
    painted = shaded(View(0.0, 0.0, cut_mm=4.0), CUBE_POINTS[faces], CUBE_POINTS[faces, 1], corner_normals, _GREY)
    np.testing.assert_allclose(painted.corners[..., 0], 10.0)
    areas = 0.5 * np.linalg.norm(
        np.cross(painted.corners[:, 1] - painted.corners[:, 0], painted.corners[:, 2] - painted.corners[:, 0]), axis=1
    )
    assert painted.corners[..., 2].max() == 4.0
    np.testing.assert_allclose(areas.sum(), 40.0)


def test_values_are_interpolated_between_the_corners() -> None:
    corners = np.array([[[0, 0, 0], [0, 10, 0], [0, 0, 10]]], dtype=float)
    lit = np.tile(View(0.0, 0.0).axes[2], (1, 3, 1))
    painted = shaded(View(0.0, 0.0), corners, corners[..., 1], lit, _GREY)
    grey = painted.rgb[:, 0] / painted.rgb[:, 0].max()
    middle = painted.corners[..., 1].mean(axis=1)
    np.testing.assert_allclose(grey, middle / middle.max(), atol=0.01)
    assert len(grey) == 64


def test_strokes_keep_their_place_and_width_and_end_at_the_cut() -> None:
    view = View(30.0, 20.0, cut_mm=5.0)
    lines = np.array([[[1.0, 2.0, 1.0], [1.0, 2.0, 9.0]]])
    corners = strokes(view, lines, np.zeros((1, 3)), width_mm=0.5, lift_mm=3.0).corners @ view.axes.T
    np.testing.assert_allclose(np.ptp(corners[..., 0]), 0.5)
    start, middle = lines[0, 0] @ view.axes.T, np.array([1.0, 2.0, 5.0]) @ view.axes.T
    np.testing.assert_allclose([corners[..., 1].min(), corners[..., 1].max()], [start[1], middle[1]])
    np.testing.assert_allclose(corners[..., 0].mean(), start[0])
    assert corners[..., 2].min() >= min(start[2], middle[2]) + 2.9


@pytest.mark.parametrize("level", [2.5, 5.0, 9.0])
def test_the_cut_face_is_the_whole_cross_section(level: float) -> None:
    triangles, element = section(CUBE_POINTS, CUBE_CELLS, level - CUBE_POINTS @ np.array([0.0, 0.6, 0.8]))
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    np.testing.assert_allclose(triangles @ np.array([0.0, 0.6, 0.8]), level)
    # The line 0.6 y + 0.8 z = level within the square, times the length along x.
    y = np.clip((level - 0.8 * np.array([0.0, 10.0])) / 0.6, 0.0, 10.0)
    np.testing.assert_allclose(areas.sum(), 10.0 * abs(y[0] - y[1]) / 0.8)
    assert set(element) <= set(range(len(CUBE_CELLS)))


def test_the_rim_of_the_cut_is_closed() -> None:
    faces, element = surface(CUBE_CELLS)
    assert len(faces) == 12
    assert all(set(face) < set(CUBE_CELLS[number]) for face, number in zip(faces, element, strict=True))
    rim, _ = section(CUBE_POINTS, faces, CUBE_POINTS[:, 2] - 4.0)
    np.testing.assert_allclose(rim[..., 2], 4.0)
    np.testing.assert_allclose(np.linalg.norm(rim[:, 1] - rim[:, 0], axis=1).sum(), 40.0)


def test_edges_of_a_cube_stay_sharp() -> None:
    faces, _ = surface(CUBE_CELLS)
    own = normals(CUBE_POINTS, faces)
    np.testing.assert_allclose(
        (smoothing(CUBE_POINTS, faces) @ own).reshape(-1, 3, 3), np.repeat(own[:, None], 3, axis=1)
    )
    edges = CUBE_POINTS[sharp_edges(CUBE_POINTS, faces)]
    np.testing.assert_allclose(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1), np.full(12, 10.0))


def test_a_smooth_surface_is_shaded_smoothly() -> None:
    bent = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    own = normals(bent, faces)
    at_corners = (smoothing(bent, faces) @ own).reshape(2, 3, 3)
    np.testing.assert_allclose(at_corners[0, [0, 2]], np.tile(own.mean(axis=0), (2, 1)))
    np.testing.assert_allclose(at_corners[0, 1], own[0])


def test_what_is_interpolated_along_a_cut_is_what_varies_linearly() -> None:
    values = CUBE_POINTS @ np.array([0.3, -1.0, 0.7])
    triangles, _ = section(np.column_stack([CUBE_POINTS, values]), CUBE_CELLS, CUBE_POINTS[:, 0] - 3.0)
    np.testing.assert_allclose(triangles[..., 3], triangles[..., :3] @ np.array([0.3, -1.0, 0.7]), atol=1e-12)


def test_faces_are_divided_into_bands_that_lose_nothing() -> None:
    corners = CUBE_POINTS[surface(CUBE_CELLS)[0]]
    values = corners @ np.array([0.5, 0.3, 0.2])
    levels = (1.0, 2.5, 5.0, 9.0)
    pieces = divided(np.concatenate([corners, values[..., None]], axis=2), 3, levels)
    across = np.cross(pieces[:, 1, :3] - pieces[:, 0, :3], pieces[:, 2, :3] - pieces[:, 0, :3])
    np.testing.assert_allclose(0.5 * np.linalg.norm(across, axis=1).sum(), 600.0)
    # Each piece is in one band, and looks the way its face did: out of the cube.
    bands = np.array([0.0, *levels, 10.0])
    low, high = pieces[..., 3].min(axis=1), pieces[..., 3].max(axis=1)
    number = np.digitize(pieces[..., 3].mean(axis=1), bands)
    assert (low >= bands[number - 1] - 1e-9).all()
    assert (high <= bands[number] + 1e-9).all()
    assert (np.einsum("ni,ni->n", across, pieces[..., :3].mean(axis=1) - 5.0) >= -1e-9).all()


def test_pictures_side_by_side_have_one_scale() -> None:
    view = View(-90.0, 0.0)
    wide, high = (view.window(CUBE_POINTS * np.array(sides)) for sides in ((4.0, 1.0, 1.0), (1.0, 1.0, 3.0)))
    assert wide.as_large_as([high])[1:] == high.as_large_as([wide])[1:] == (20.0, 15.0)
    np.testing.assert_allclose(wide.as_large_as([high]).middle @ view.axes[:2].T, [20.0, 5.0])
