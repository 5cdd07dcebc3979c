"""If these fail, the heart's ejection is wrong even where its motion is right: volumes are not what is enclosed."""

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry.biventricle import Biventricle
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mechanics.elements.linear import linear
from cardiac_cosim.units.mechanics.loads.cavity_pressure import CavityPressure
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.cavity import cavity_faces

_LV, _RV = ("lv_endocardium",), ("rv_endocardium", "rv_septum")


def _deformed(points: np.ndarray) -> np.ndarray:
    """A large smooth deformation that keeps the plane Z = 0 in itself, yet moves and shears within it."""
    x, y, z = points.T
    return np.stack(
        [
            1.1 * x + 0.02 * y * z + 0.5 * np.sin(0.3 * y) + 2.0,
            0.9 * y + 0.015 * x * z + 0.4 * np.cos(0.2 * x),
            z * (1.0 + 0.02 * x + 0.01 * y),
        ],
        axis=1,
    )


def _volume(mesh: Mesh, names: tuple[str, ...], points: np.ndarray) -> float:
    """In ml, as mechanics has it, with the nodes at `points`."""
    return 1e-3 * CavityPressure(linear(mesh), cavity_faces(mesh, names)).volume(points - mesh.points)


def _enclosed(points: np.ndarray, cells: np.ndarray) -> float:
    corners = points[cells]
    return float(np.linalg.det(corners[:, 1:] - corners[:, :1]).sum()) / 6000.0


@pytest.fixture(scope="module")
def filled(box, two_chambers) -> tuple[Mesh, dict[tuple[str, ...], np.ndarray]]:
    """The box of which the two chambers are cut, and the tetrahedra that fill each cavity."""
    whole = box(5.0 * np.arange(-3, 5), 5.0 * np.arange(-2, 3), 5.0 * np.arange(-3, 1))
    x, y, z = whole.centroids.T
    inside = (np.abs(y) < 5.0) & (z > -10.0)
    return whole, {_LV: whole.cells[inside & (np.abs(x + 5.0) < 5.0)], _RV: whole.cells[inside & (np.abs(x - 10) < 5)]}


@pytest.mark.parametrize("names", [_LV, _RV])
def test_box_shaped_cavities_are_exact(names: tuple[str, ...], two_chambers) -> None:
    # 10 x 10 x 10 mm.
    assert _volume(two_chambers, names, two_chambers.points) == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("names", [_LV, _RV])
def test_deformed_cavity_is_the_volume_of_the_tetrahedra_that_fill_it(names, two_chambers, filled) -> None:
    # The lid's triangles stay in the plane Z = 0, so that the filling is closed by them without a gap.
    whole, fillings = filled
    moved, exact = _deformed(two_chambers.points), _enclosed(_deformed(whole.points), fillings[names])
    assert abs(exact - 1.0) > 0.005
    assert _volume(two_chambers, names, moved) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("shift", [[100.0, 0, 0], [0, -50.0, 0], [30.0, 20.0, 0], [0, 0, 40.0]])
def test_volume_does_not_change_with_the_place(shift: list[float], two_chambers) -> None:
    for names in (_LV, _RV):
        moved = _deformed(two_chambers.points)
        assert _volume(two_chambers, names, moved + shift) == pytest.approx(
            _volume(two_chambers, names, moved), rel=1e-11
        )


def test_volume_does_not_change_with_a_turn_about_the_axis(two_chambers) -> None:
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    for names in (_LV, _RV):
        moved = _deformed(two_chambers.points)
        assert _volume(two_chambers, names, moved @ turn.T) == pytest.approx(
            _volume(two_chambers, names, moved), rel=1e-11
        )


def test_volume_scales_with_the_cube_of_the_length(two_chambers) -> None:
    assert _volume(two_chambers, _LV, 0.5 * two_chambers.points) == pytest.approx(0.125, rel=1e-13)


def test_hearts_cavities_are_the_closed_forms(heart) -> None:
    # Closed forms 39.358 and 13.452 ml (docs/model.md, Geometry), facetted at 5 mm: within 2 %.
    anatomy = Biventricle()
    volumes = [_volume(heart, names, heart.points) for names in (_LV, _RV)]
    assert volumes == pytest.approx([39.358, 13.452], rel=0.02)
    assert 1e-3 * anatomy.lv_cavity_volume == pytest.approx(39.358, abs=1e-3)
    assert 1e-3 * anatomy.rv_cavity_volume == pytest.approx(13.452, abs=1e-3)


def test_emptied_cavity_has_no_volume(two_chambers) -> None:
    # Squeezed flat in x about the septum's plane.
    points = two_chambers.points * [1e-9, 1.0, 1.0]
    assert abs(_volume(two_chambers, _LV, points)) < 1e-8


def test_cavity_open_elsewhere_is_refused(two_chambers) -> None:
    # The RV without its septum, and the LV with one face of its wall missing.
    with pytest.raises(InvalidInput, match=r"rv_endocardium has a rim off the base.*cover all"):
        cavity_faces(two_chambers, ("rv_endocardium",))
    faces = two_chambers.boundary("lv_endocardium")
    low = two_chambers.points[faces, 2].mean(axis=1).argmin()
    boundaries = {"lv_endocardium": np.delete(faces, low, axis=0), "base": two_chambers.boundary("base")}
    leaky = Mesh(two_chambers.points, two_chambers.cells, boundaries)
    with pytest.raises(InvalidInput, match="lv_endocardium has a rim off the base"):
        cavity_faces(leaky, _LV)


def test_base_that_is_not_plane_is_refused(two_chambers) -> None:
    for lift, sound in ((0.9e-3, True), (1.1e-3, False)):
        points = two_chambers.points.copy()
        rim = np.flatnonzero((points[:, 2] == 0.0) & (points[:, 0] == -10.0) & (points[:, 1] == 0.0))
        assert len(rim) == 1
        points[rim, 2] += lift
        mesh = Mesh(points, two_chambers.cells, two_chambers.boundaries)
        if sound:
            cavity_faces(mesh, _LV)
        else:
            with pytest.raises(InvalidInput, match="one plane Z = constant"):
                cavity_faces(mesh, _LV)


def test_a_unit_alone_refuses_a_base_that_is_not_plane(two_chambers, along, started) -> None:
    # Whoever uses its FMU has nobody else to look at the mesh.
    points = two_chambers.points.copy()
    points[(points[:, 2] == 0.0) & (points[:, 0] == -10.0) & (points[:, 1] == 0.0), 2] += 0.5
    mesh = Mesh(points, two_chambers.cells, two_chambers.boundaries)
    with pytest.raises(InvalidInput, match="one plane Z = constant"):
        started(Mechanics, mesh, fiber=along(mesh, (1, 0, 0)), sheet=along(mesh, (0, 1, 0)))


def test_cavity_open_below_the_base_is_refused(two_chambers) -> None:
    # A wall that ends in a plane ring 5 mm below the base: that ring moves, and the opening's normal with it.
    faces = two_chambers.boundary("lv_endocardium")
    lower = faces[two_chambers.points[faces, 2].max(axis=1) < -4.0]
    short = Mesh(
        two_chambers.points,
        two_chambers.cells,
        {"lv_endocardium": lower, "base": two_chambers.boundary("base")},
    )
    with pytest.raises(InvalidInput, match="base"):
        cavity_faces(short, _LV)
