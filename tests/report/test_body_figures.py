"""If these fail, a person is shown another body, other surfaces or another stimulus than the run had."""

from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.boundaries import boundaries
from cardiac_cosim.report.figures.geometry import geometry
from cardiac_cosim.report.figures.skin import Skin
from cardiac_cosim.report.figures.stimulus import stimulus
from cardiac_cosim.report.figures.viewpoints import BACK, FRONT, facing
from cardiac_cosim.units.geometry.grid import sheet, slab, strand
from cardiac_cosim.units.mesh import Mesh
from matplotlib.axes import Axes
from stored_body import CUBE_POINTS, drawn, stored, titles


def _of(mesh: Mesh, folder: Path) -> StoredRun:
    return stored(folder, mesh.points, mesh.cells, boundaries=mesh.boundaries)


def _texts(axis: Axes) -> list[str]:
    return [text.get_text() for text in axis.texts if text.get_text()]


def test_the_dimensions_of_a_heart_are_those_of_its_walls_and_cavities(small_heart: Mesh, tmp_path: Path) -> None:
    figure = drawn(geometry(_of(small_heart, tmp_path)))
    _, _, lengthwise, above = figure.axes
    # Height; then from left to right the left wall, its cavity, the septum, the right cavity and its wall, which on
    # this coarse mesh is cut where it is thinner than its 6 mm.
    height, *widths = [text for text in _texts(lengthwise) if text not in ("LV", "RV")]
    assert height == "70"
    assert widths[:4] == ["12", "36", "12", "15"]
    assert 5.0 < float(widths[4]) <= 6.0
    for axis in (lengthwise, above):
        left, right = (next(text for text in axis.texts if text.get_text() == side) for side in ("LV", "RV"))
        # The left cavity is around the axis, the right one from 30 to 45 mm beside it.
        assert abs(left.get_position()[0]) < 1.0
        assert 30.0 < right.get_position()[0] < 45.0
    note = figure.get_supxlabel()
    assert f"{small_heart.elements} elements with {small_heart.nodes} nodes" in note


def test_a_piece_of_wall_has_no_cavities(tmp_path: Path) -> None:
    _, _, lengthwise, above = drawn(geometry(_of(slab(6.0), tmp_path))).axes
    assert _texts(lengthwise) == ["30", "30"]
    assert _texts(above) == ["12", "30"]


def test_a_boundary_is_exactly_its_faces(small_heart: Mesh, tmp_path: Path) -> None:
    run = _of(small_heart, tmp_path)
    assert run.mesh is not None
    skin = Skin(run.mesh)
    found = {name: skin.places(faces) for name, faces in run.boundaries.items()}
    # Together they are the whole skin, and each face is in one of them.
    assert sorted(np.concatenate(list(found.values()))) == list(range(len(skin.faces)))
    base = run.mesh.points[skin.faces[found["base"]]]
    np.testing.assert_array_equal(base[..., 2], 0.0)
    # A line or a point is no face.
    assert not len(skin.places(np.array([[0, 1]])))


def test_a_heart_shows_what_is_in_contact_with_what(small_heart: Mesh, tmp_path: Path) -> None:
    figure = drawn(boundaries(_of(small_heart, tmp_path)))
    assert titles(figure) == ["epicardium", "endocardia (front half cut away)", "base"]
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named == ["epicardium", "LV endocardium", "RV endocardium", "RV septum", "base"]


def test_both_sides_of_a_piece_of_wall_are_seen_from_their_own_side(tmp_path: Path) -> None:
    assert titles(drawn(boundaries(_of(slab(6.0), tmp_path)))) == ["epicardium", "endocardium", "base"]
    sides = {side: facing(np.tile([0.0, side, 0.0], (3, 1))) for side in (1.0, -1.0)}
    for side, view in sides.items():
        assert view.axes[2] @ np.array([0.0, side, 0.0]) > 0.9
    # What bends around the body has no side of its own.
    assert facing(np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])) is FRONT
    assert BACK.axes[2][1] > 0.0 > FRONT.axes[2][1]


@pytest.mark.parametrize("scene", [strand(10.0), sheet(20.0)])
def test_scenes_without_a_solid_have_no_figures_of_one(scene: Mesh, tmp_path: Path) -> None:
    run = _of(scene, tmp_path)
    assert geometry(run) is None
    assert boundaries(run) is None


def test_a_body_without_names_has_no_figure_of_boundaries(tmp_path: Path) -> None:
    assert boundaries(stored(tmp_path)) is None


def test_the_stimulus_is_where_the_potential_is_raised_at_the_start(tmp_path: Path) -> None:
    # The edge along Y at X = 10 mm, on top.
    potential = np.where((CUBE_POINTS[:, 0] > 0.0) & (CUBE_POINTS[:, 2] > 0.0), -10.0, -80.0)
    figure = drawn(stimulus(stored(tmp_path, times=(0.0,), frames={"potential_mV": potential[None]})))
    assert figure.get_supxlabel() == "−10 mV at 2 of 8 nodes: X 10, Y 0 to 10, Z 10 mm (dashed)"
    (box,) = figure.axes[1].patches
    np.testing.assert_allclose(box.get_bbox().get_points(), [[10.0, 0.0], [10.0, 10.0]])
    assert figure.axes[2].get_xlabel() == "transmembrane potential at 0 ms (mV)"


@pytest.mark.parametrize(
    ("begin", "raised"), [(0.0, 0), (0.0, 6), (5.0, 2)], ids=["at rest", "nearly everywhere", "not the start"]
)
def test_without_a_place_where_the_wave_begins_there_is_no_stimulus(tmp_path: Path, begin: float, raised: int) -> None:
    potential = np.where(np.arange(8) < raised, -10.0, -80.0)
    assert stimulus(stored(tmp_path, times=(begin,), frames={"potential_mV": potential[None]})) is None
