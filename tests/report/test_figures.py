"""If these fail, a person judges a run by pictures that show other times, places or angles than the run had."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.participants.participant import Values
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.draw import draw_figures
from cardiac_cosim.report.figures.fiber_layout import fiber_lines, helix_angle
from cardiac_cosim.report.figures.heart_potential import chosen_frames
from cardiac_cosim.report.figures.pressure_volume import pressure_volume
from cardiac_cosim.report.figures.scene import View, shaded, strokes
from cardiac_cosim.report.figures.surface import normals, section, sharp_edges, smoothing, surface
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

# A cube of 10 mm made of six tetrahedra around its diagonal.
_POINTS = 10.0 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_CELLS = np.array([[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]])
_GREY = ScalarMappable(Normalize(0.0, 10.0), "gray")
_PNG_START = b"\x89PNG"
_ALL = ["fiber_layout", "potential_on_deformed_heart", "potential_at_probes", "cavity_volumes", "pressure_volume"]


def _write_fields(folder: Path, times: tuple[float, ...], *without: str, prefix: str = "") -> None:
    fixed = {"fiber": np.tile([1.0, 0.0, 0.0], (len(_CELLS), 1)), "sheet": np.tile([0.0, 1.0, 0.0], (len(_CELLS), 1))}
    frames = {
        f"{prefix}potential_mV": np.linspace(-80.0, 20.0, len(times) * len(_POINTS)).reshape(len(times), len(_POINTS)),
        "displacement_mm": 0.1 * np.arange(len(times))[:, None, None] * np.ones((1, len(_POINTS), 3)),
    }
    with h5py.File(folder / "fields.h5", "w") as file:
        file["points_mm"], file["cells"], file["frames_ms"] = _POINTS, _CELLS, np.array(times, dtype=float)
        for name, values in fixed.items():
            if name not in without:
                file[name] = values
        group = file.create_group("frames")
        for name, values in frames.items():
            if name not in without:
                group[name] = values


def _write_series(folder: Path, text: str) -> None:
    (folder / "timeseries.csv").write_text(text, encoding="utf-8")


def _names(drawn: list[Path]) -> list[str]:
    return [path.stem for path in drawn]


def test_every_figure_is_drawn_from_what_a_run_leaves(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0, 5.0))
    columns = "time_ms,potential_apex_mV,lv_volume_ml,lv_pressure_kPa"
    _write_series(tmp_path, f"{columns}\n0.0,-80.0,38.0,0.0\n5.0,-79.0,37.5,0.1\n")
    drawn = draw_figures(tmp_path)
    assert _names(drawn) == [*_ALL, "other_outputs"]
    for path in drawn:
        assert path.parent == tmp_path / "figures"
        assert path.read_bytes().startswith(_PNG_START)
        assert path.stat().st_size > 5000


def test_pressure_is_drawn_over_the_volume_of_its_own_cavity(tmp_path: Path) -> None:
    # Gaps are of units that step less often; a pressure that nobody changes makes no curve.
    names = "time_ms,lv_volume_ml,rv_pressure_kPa,lv_pressure_kPa,rv_volume_ml"
    _write_series(tmp_path, f"{names}\n0.0,38.0,1.0,0.0,12.0\n5.0,,1.0,0.5,13.0\n9.0,40.0,1.0,1.5,14.0\n")
    figure = pressure_volume(StoredRun(tmp_path))
    assert figure is not None
    curve, begin = figure.axes[0].lines
    assert curve.get_label() == "left ventricle; the dot is the beginning"
    np.testing.assert_array_equal(curve.get_xydata(), [[38.0, 0.0], [40.0, 1.5]])
    np.testing.assert_array_equal(begin.get_xydata(), [[38.0, 0.0]])


@pytest.mark.parametrize(
    ("without", "columns", "expected"),
    [
        (("fiber",), "potential_apex_mV", _ALL[1:3]),
        (("sheet", "displacement_mm"), "lv_volume_ml", [_ALL[0], _ALL[1], _ALL[3]]),
        (("potential_mV",), "apex_uplift_mm", [_ALL[0]]),
    ],
)
def test_a_figure_without_data_is_skipped(
    tmp_path: Path, without: tuple[str, ...], columns: str, expected: list[str]
) -> None:
    _write_fields(tmp_path, (0.0,), *without)
    _write_series(tmp_path, f"time_ms,{columns}\n0.0,1.0\n")
    assert _names(draw_figures(tmp_path)) == expected


def test_an_empty_folder_and_a_run_that_failed_at_once_have_no_figures(tmp_path: Path) -> None:
    assert draw_figures(tmp_path) == []
    assert not (tmp_path / "figures").exists()
    _write_fields(tmp_path, (), "fiber")
    _write_series(tmp_path, "time_ms,potential_apex_mV,lv_volume_ml\n")
    assert draw_figures(tmp_path) == []


def test_no_figure_of_an_earlier_run_stays(tmp_path: Path) -> None:
    _write_series(tmp_path, "time_ms,lv_volume_ml\n0.0,38.0\n")
    (old,) = draw_figures(tmp_path)
    _write_series(tmp_path, "time_ms,active_stress_mean_kPa\n0.0,0.0\n")
    assert draw_figures(tmp_path) == []
    assert not old.exists()


def test_a_run_reads_back_as_written(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0, 5.0), prefix="electrophysiology.")
    _write_series(tmp_path, "time_ms,potential_apex_mV\n0.0,-80.0\n1.0,\n2.0")
    run = StoredRun(tmp_path)
    second = run.frame("potential_mV", 1)
    assert second is not None
    assert second[-1] == 20.0
    assert run.frame("potential_mV", 2) is None
    assert run.initial("fibre") is None
    np.testing.assert_array_equal(run.columns["potential_apex_mV"], [-80.0, np.nan])
    assert run.end_ms == 5.0


@pytest.mark.parametrize(
    ("times", "end", "expected"),
    [
        (np.arange(0.0, 325.0, 5.0), 320.0, [5.0, 35.0, 55.0, 100.0, 145.0, 200.0, 250.0, 300.0]),
        (np.arange(0.0, 121.0, 20.0), 120.0, [0.0, 40.0, 60.0, 100.0]),
        (np.array([0.0, 50.0]), 54.0, [0.0, 50.0]),
        (np.array([0.0]), 3.0, [0.0]),
        (np.array([0.0, 2.0]), 3.0, [2.0]),
    ],
)
def test_the_nearest_frames_are_chosen(times: Values, end: float, expected: list[float]) -> None:
    assert times[chosen_frames(times, end)].tolist() == expected


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


def test_only_faces_that_face_the_eye_are_drawn_and_only_up_to_the_cut() -> None:
    faces, _ = surface(_CELLS)
    corner_normals = np.repeat(normals(_POINTS, faces)[:, None], 3, axis=1)
    painted = shaded(View(0.0, 0.0, cut_mm=4.0), _POINTS[faces], _POINTS[faces, 1], corner_normals, _GREY)
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
    triangles, element = section(_POINTS, _CELLS, level - _POINTS @ np.array([0.0, 0.6, 0.8]))
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    np.testing.assert_allclose(triangles @ np.array([0.0, 0.6, 0.8]), level)
    # The line 0.6 y + 0.8 z = level within the square, times the length along x.
    y = np.clip((level - 0.8 * np.array([0.0, 10.0])) / 0.6, 0.0, 10.0)
    np.testing.assert_allclose(areas.sum(), 10.0 * abs(y[0] - y[1]) / 0.8)
    assert set(element) <= set(range(len(_CELLS)))


def test_the_rim_of_the_cut_is_closed() -> None:
    faces, element = surface(_CELLS)
    assert len(faces) == 12
    assert all(set(face) < set(_CELLS[number]) for face, number in zip(faces, element, strict=True))
    rim, _ = section(_POINTS, faces, _POINTS[:, 2] - 4.0)
    np.testing.assert_allclose(rim[..., 2], 4.0)
    np.testing.assert_allclose(np.linalg.norm(rim[:, 1] - rim[:, 0], axis=1).sum(), 40.0)


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


def test_edges_of_a_cube_stay_sharp() -> None:
    faces, _ = surface(_CELLS)
    own = normals(_POINTS, faces)
    np.testing.assert_allclose((smoothing(_POINTS, faces) @ own).reshape(-1, 3, 3), np.repeat(own[:, None], 3, axis=1))
    edges = _POINTS[sharp_edges(_POINTS, faces)]
    np.testing.assert_allclose(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1), np.full(12, 10.0))


def test_a_smooth_surface_is_shaded_smoothly() -> None:
    bent = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    own = normals(bent, faces)
    at_corners = (smoothing(bent, faces) @ own).reshape(2, 3, 3)
    np.testing.assert_allclose(at_corners[0, [0, 2]], np.tile(own.mean(axis=0), (2, 1)))
    np.testing.assert_allclose(at_corners[0, 1], own[0])
