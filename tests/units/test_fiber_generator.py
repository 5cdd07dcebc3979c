"""If these fail, muscle fibres run the wrong way: the heart twists and conducts as no heart does.

Against a thick-walled tube around the Z axis, where the wall direction is the radius, the distance through the wall is
linear in it, and the fibre's angle follows in closed form.
"""

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator.unit import FiberGenerator, relative_distance, rotated_fiber
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.transmural import transmural_direction, wall_distance

_INNER, _OUTER, _BOTTOM = 10.0, 20.0, -30.0
_ENDOCARDIUM = ("lv_endocardium", "rv_endocardium")
_EPICARDIUM = ("epicardium", "rv_septum")


@pytest.fixture(scope="module")
def tube(box):
    """A tube with the given number of elements through its wall; the two halves of each surface bear two names."""
    made: dict[int, Mesh] = {}

    def rolled(points: np.ndarray) -> np.ndarray:
        radius, angle, z = points.T
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)

    def make(through: int) -> Mesh:
        if through not in made:
            around = np.linspace(0.0, 2.0 * np.pi, 8 * through + 1)
            made[through] = box(
                np.linspace(_INNER, _OUTER, through + 1),
                around,
                np.linspace(_BOTTOM, -20.0, through + 1),
                mapped=rolled,
                lv_endocardium=lambda at: (at[:, 0] < _INNER + 1e-6) & (at[:, 1] < np.pi),
                rv_endocardium=lambda at: (at[:, 0] < _INNER + 1e-6) & (at[:, 1] > np.pi),
                epicardium=lambda at: (at[:, 0] > _OUTER - 1e-6) & (at[:, 1] < np.pi),
                rv_septum=lambda at: (at[:, 0] > _OUTER - 1e-6) & (at[:, 1] > np.pi),
            )
        return made[through]

    return make


def _parts(mesh: Mesh) -> dict[str, np.ndarray]:
    """The tube's surfaces as those of a left ventricle: both halves under one name, the ends apart."""
    halves = {"lv_endocardium": _ENDOCARDIUM, "epicardium": _EPICARDIUM}
    named = {name: np.concatenate([mesh.boundary(part) for part in parts]) for name, parts in halves.items()}
    taken = {tuple(face) for faces in named.values() for face in np.sort(faces, axis=1).tolist()}
    return named | {"ends": np.array([face for face in mesh.surface.tolist() if tuple(sorted(face)) not in taken])}


def _left_ventricle(mesh: Mesh) -> Mesh:
    parts = _parts(mesh)
    return Mesh(mesh.points, mesh.cells, {"base" if name == "ends" else name: faces for name, faces in parts.items()})


def _polar(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radius of the element centres, and the unit vectors outward and around (counter-clockwise from above)."""
    radius = np.linalg.norm(mesh.centroids[:, :2], axis=1)
    outward = mesh.centroids * [1.0, 1.0, 0.0] / radius[:, None]
    return radius, outward, np.cross([0.0, 0.0, 1.0], outward)


def _measured_angle(mesh: Mesh, fiber: np.ndarray) -> np.ndarray:
    """Angle in degrees by which the fibre climbs when it goes counter-clockwise: right-handed if positive."""
    _, _, around = _polar(mesh)
    along = np.einsum("ei,ei->e", fiber, around)
    return np.rad2deg(np.arctan(fiber[:, 2] / along))


def _mean(mesh: Mesh, values: np.ndarray) -> float:
    return float(np.sqrt(mesh.volumes @ values**2 / mesh.volumes.sum()))


# --- the tube ------------------------------------------------------------------------------------------------------


def test_sheet_is_radial_and_converges(tube, slopes) -> None:
    # A gradient that is constant per element: first order.
    through, errors = [2, 4, 8], []
    for count in through:
        mesh = tube(count)
        _, outward, _ = _polar(mesh)
        sheet = transmural_direction(mesh, _ENDOCARDIUM, _EPICARDIUM)
        errors.append(_mean(mesh, np.linalg.norm(sheet - outward, axis=1)))
        # From endocardium to epicardium, never inward.
        assert np.einsum("ei,ei->e", sheet, outward).min() > 0.8
    orders = slopes([1.0 / count for count in through], errors)
    assert ((orders > 0.85) & (orders < 1.2)).all(), orders
    assert errors[-1] < 0.05


def test_relative_distance_is_linear_in_the_radius(tube, slopes) -> None:
    through, errors = [2, 4, 8], []
    for count in through:
        mesh = tube(count)
        inward = relative_distance(
            wall_distance(mesh.points, mesh, _EPICARDIUM), wall_distance(mesh.points, mesh, _ENDOCARDIUM)
        )
        radius = np.linalg.norm(mesh.points[:, :2], axis=1)
        on_surface = np.isclose(radius, _INNER) | np.isclose(radius, _OUTER)
        np.testing.assert_allclose(inward[on_surface], np.isclose(radius, _INNER)[on_surface], atol=1e-12)
        # The facets of the surfaces lie off the circles by a second-order distance.
        errors.append(np.abs(inward - (_OUTER - radius) / (_OUTER - _INNER)).max())
    orders = slopes([1.0 / count for count in through[1:]], errors[1:])
    assert ((orders > 1.7) & (orders < 2.4)).all(), (orders, errors)


def test_angle_follows_the_rule_and_converges(tube, started, slopes) -> None:
    through, errors = [2, 4, 8], []
    for count in through:
        mesh = tube(count)
        fiber = started(FiberGenerator, _left_ventricle(mesh)).get("fiber")
        radius, _, _ = _polar(mesh)
        inward = (_OUTER - radius) / (_OUTER - _INNER)
        expected = 60.0 * (2.0 * inward - 1.0) * (1.0 + mesh.centroids[:, 2] / 70.0)
        errors.append(_mean(mesh, _measured_angle(mesh, fiber) - expected))
    orders = slopes([1.0 / count for count in through], errors)
    assert ((orders > 1.8) & (orders < 2.2)).all(), (orders, errors)
    assert errors[-1] < 0.3


@pytest.mark.parametrize(("end", "epi"), [(60.0, -60.0), (80.0, -30.0)])
def test_angles_at_the_two_surfaces(end: float, epi: float, tube, started) -> None:
    # Far from the apex in units of its depth the scaling by height is 1.
    mesh = _left_ventricle(tube(8))
    parameters = {"endocardial_angle_deg": end, "epicardial_angle_deg": epi, "apex_z_mm": -1e9}
    angle = _measured_angle(mesh, started(FiberGenerator, mesh, parameters).get("fiber"))
    radius, _, _ = _polar(mesh)
    slope, at_inner = np.polyfit(radius - _INNER, angle, 1)
    assert at_inner == pytest.approx(end, abs=1.0)
    assert at_inner + slope * (_OUTER - _INNER) == pytest.approx(epi, abs=1.0)


def test_helix_is_right_handed_inside_and_left_handed_outside(tube, started) -> None:
    mesh = _left_ventricle(tube(8))
    angle = _measured_angle(mesh, started(FiberGenerator, mesh).get("fiber"))
    radius, _, _ = _polar(mesh)
    assert (angle[radius < 12.0] > 10.0).all()
    assert (angle[radius > 18.0] < -10.0).all()


def test_angle_goes_to_zero_at_the_apex_linearly(tube, started) -> None:
    mesh = _left_ventricle(tube(4))
    # The bottom is the apex: the slope of θ/θ(Z_apex → −∞) along Z is 1/30 and its zero at Z = −30 mm.
    angles = [
        _measured_angle(mesh, started(FiberGenerator, mesh, {"apex_z_mm": apex}).get("fiber"))
        for apex in (_BOTTOM, -1e9)
    ]
    steep = np.abs(angles[1]) > 20.0
    ratio = angles[0][steep] / angles[1][steep]
    z = mesh.centroids[steep, 2]
    assert np.ptp(z) > 5.0
    np.testing.assert_allclose(ratio, 1.0 - z / _BOTTOM, atol=0.03)


def test_equal_angles_give_one_angle_everywhere(tube, started) -> None:
    mesh = _left_ventricle(tube(4))
    parameters = {"endocardial_angle_deg": 30.0, "epicardial_angle_deg": 30.0, "apex_z_mm": -1e12}
    unit = started(FiberGenerator, mesh, parameters)
    fiber, sheet = unit.get("fiber"), unit.get("sheet")
    upward = np.array([0.0, 0.0, 1.0]) - sheet[:, 2:] * sheet
    upward /= np.linalg.norm(upward, axis=1)[:, None]
    np.testing.assert_allclose(np.einsum("ei,ei->e", fiber, upward), -0.5, rtol=1e-9)


@pytest.mark.parametrize("where", ["tube", "heart"])
def test_directions_are_orthonormal(where: str, tube, heart, started) -> None:
    mesh = _left_ventricle(tube(4)) if where == "tube" else heart
    unit = started(FiberGenerator, mesh)
    fiber, sheet = unit.get("fiber"), unit.get("sheet")
    np.testing.assert_allclose(np.linalg.norm(fiber, axis=1), 1.0, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(sheet, axis=1), 1.0, rtol=0.0, atol=1e-12)
    assert np.abs(np.einsum("ei,ei->e", fiber, sheet)).max() < 1e-12


def test_steps_change_nothing(tube, started) -> None:
    unit = started(FiberGenerator, _left_ventricle(tube(2)))
    before = unit.get("fiber"), unit.get("sheet")
    unit.do_step(0.0, 0.5)
    np.testing.assert_array_equal(unit.get("fiber"), before[0])
    np.testing.assert_array_equal(unit.get("sheet"), before[1])


# --- elements without a direction of their own ---------------------------------------------------------------------


def test_elements_on_one_surface_take_their_neighbours_direction(box) -> None:
    # A plate with one element through its wall whose left end is endocardium on both sides.
    def thick(at: np.ndarray) -> np.ndarray:
        return at[:, 0] > 2.0

    mesh = box(
        np.arange(7.0),
        [0.0, 1.0, 2.0],
        [0.0, 1.0],
        lv_endocardium=lambda at: (at[:, 2] < 0.01) | ((at[:, 2] > 0.99) & ~thick(at)),
        epicardium=lambda at: (at[:, 2] > 0.99) & thick(at),
    )
    w = np.zeros(mesh.nodes)
    w[mesh.boundary_nodes("lv_endocardium")] = 1.0
    w[mesh.boundary_nodes("epicardium")] = 0.0
    flat = np.ptp(w[mesh.cells], axis=1) == 0.0
    assert 0 < flat.sum() < mesh.elements
    sheet = transmural_direction(mesh, ("lv_endocardium",), ("epicardium",))
    np.testing.assert_allclose(np.linalg.norm(sheet, axis=1), 1.0, rtol=1e-14)
    # Away from the end the way through the plate is up, and the filled elements are no exception: no one points back.
    np.testing.assert_allclose(sheet[mesh.points[mesh.cells, 0].min(axis=1) >= 3.0], [[0.0, 0.0, 1.0]] * 36, atol=1e-12)
    assert (sheet[flat] @ [0.5, 0.0, 1.0] > 0.0).all()


def test_filling_reaches_elements_without_a_neighbour_that_has_a_direction(box) -> None:
    def thick(at: np.ndarray) -> np.ndarray:
        return at[:, 0] > 5.0

    mesh = box(
        np.arange(8.0),
        [0.0, 1.0],
        [0.0, 1.0],
        lv_endocardium=lambda at: (at[:, 2] < 0.01) | ((at[:, 2] > 0.99) & ~thick(at)),
        epicardium=lambda at: (at[:, 2] > 0.99) & thick(at),
    )
    sheet = transmural_direction(mesh, ("lv_endocardium",), ("epicardium",))
    far = mesh.points[mesh.cells, 0].max(axis=1) <= 1.0
    assert far.sum() == 6
    np.testing.assert_allclose(np.linalg.norm(sheet[far], axis=1), 1.0, rtol=1e-14)


def test_wall_without_any_direction_is_refused(box) -> None:
    mesh = box(
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        lv_endocardium=lambda at: at[:, 2] > -1.0,
        epicardium=lambda at: at[:, 2] > -1.0,
    )
    with pytest.raises(InvalidInput, match="no direction through the wall"):
        transmural_direction(mesh, ("lv_endocardium",), ("epicardium",))


def test_node_on_both_surfaces_counts_as_epicardial(box) -> None:
    # A single layer: the rim nodes belong to both; on all of them w = 0, so that only the inner node carries w = 1.
    mesh = box(
        [0.0, 1.0, 2.0],
        [0.0, 1.0, 2.0],
        [0.0, 1.0],
        lv_endocardium=lambda at: at[:, 2] < 0.01,
        epicardium=lambda at: at[:, 2] > 0.01,
    )
    inner = np.flatnonzero((mesh.points == [1.0, 1.0, 0.0]).all(axis=1))[0]
    sheet = transmural_direction(mesh, ("lv_endocardium",), ("epicardium",))
    for cell, volume_direction in zip(mesh.cells, sheet, strict=True):
        if inner in cell:
            # −∇w points from the only node with w = 1 to the face of the others.
            opposite = mesh.points[cell[cell != inner]] - mesh.points[inner]
            assert (opposite @ volume_direction > 1e-9).all()
            np.testing.assert_allclose(np.ptp(opposite @ volume_direction), 0.0, atol=1e-12)


# --- distances -----------------------------------------------------------------------------------------------------


def test_distance_is_to_faces_not_to_nodes(box) -> None:
    mesh = box([0.0, 4.0], [0.0, 4.0], [-4.0, 0.0], top=lambda at: at[:, 2] > -0.01)
    points = np.array(
        [[1.0, 2.0, 3.0], [2.0, 1.0, -2.0], [-3.0, 2.0, 4.0], [7.0, 8.0, 0.0], [5.0, 6.0, 2.0], [0, 0, 0]]
    )
    np.testing.assert_allclose(wall_distance(points, mesh, ("top",)), [3.0, 2.0, 5.0, 5.0, 3.0, 0.0], atol=1e-12)


def test_relative_distance_where_both_vanish_is_a_half() -> None:
    np.testing.assert_array_equal(
        relative_distance(np.array([0.0, 0.0, 3.0, 1.0]), np.array([0.0, 2.0, 0.0, 3.0])), [0.5, 0.0, 1.0, 0.25]
    )


# --- refusals ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missing", ["base", *_ENDOCARDIUM, *_EPICARDIUM])
def test_missing_boundary_is_named(missing: str, two_chambers, started) -> None:
    rest = {name: faces for name, faces in two_chambers.boundaries.items() if name != missing}
    with pytest.raises(InvalidInput, match=f"no boundary named '{missing}'"):
        started(FiberGenerator, Mesh(two_chambers.points, two_chambers.cells, rest))


def test_a_left_ventricle_is_told_from_two_whose_right_one_has_no_names(tube, started) -> None:
    mesh = tube(2)
    parts = _parts(mesh)
    named = {name: faces for name, faces in parts.items() if name != "ends"}
    message = r"\d+ of \d+ faces of the surface are in none of .*no boundary named .*'rv_endocardium' or 'rv_septum'"
    with pytest.raises(InvalidInput, match=message):
        started(FiberGenerator, Mesh(mesh.points, mesh.cells, named))
    with pytest.raises(InvalidInput, match=f"{len(parts['ends'])} in 'ends'"):
        started(FiberGenerator, Mesh(mesh.points, mesh.cells, parts))
    whole = started(FiberGenerator, _left_ventricle(mesh))
    np.testing.assert_array_equal(whole.get("sheet"), transmural_direction(mesh, _ENDOCARDIUM, _EPICARDIUM))


def test_fibre_in_a_horizontal_wall_is_measured_from_the_x_axis(box, started) -> None:
    plate = box(
        [0.0, 1.0, 2.0],
        [0.0, 1.0, 2.0],
        [-1.0, 0.0],
        endocardium=lambda at: at[:, 2] > -0.01,
        epicardium=lambda at: at[:, 2] < -0.99,
    )
    unit = started(FiberGenerator, plate)
    sheet, fiber = unit.get("sheet"), unit.get("fiber")
    np.testing.assert_allclose(sheet, np.tile([0.0, 0.0, -1.0], (plate.elements, 1)), atol=1e-12)
    # e₂ = X instead of Z and e₃ = s₀ × e₂ = −Y; the endocardium is at Z = 0, 1 mm above the epicardium.
    height = plate.centroids[:, 2]
    angle = np.deg2rad(60.0) * (1.0 + 2.0 * height) * (1.0 + height / 70.0)
    by_hand = np.stack([-np.sin(angle), -np.cos(angle), np.zeros(plate.elements)], axis=1)
    np.testing.assert_allclose(fiber, by_hand, atol=1e-12)


@pytest.mark.parametrize("upward", [1.0, -1.0])
def test_fibre_is_a_unit_vector_in_the_wall_on_both_sides_of_the_vertical(upward: float) -> None:
    # From exactly vertical over rounding to a millionth of a radian and a degree off it.
    tilt = np.array([0.0, 1e-16, 1e-9, 1e-7, 1e-6, 1.4e-6, 1.5e-6, 1e-5, 1e-3, 0.02])
    for around in np.linspace(0.0, 6.0, 7):
        sheet = np.stack([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), upward * np.cos(tilt)], axis=1)
        fiber = rotated_fiber(sheet, np.linspace(-1.0, 1.0, len(tilt)))
        np.testing.assert_allclose(np.linalg.norm(fiber, axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(np.einsum("ei,ei->e", fiber, sheet), 0.0, atol=1e-9)
        # Vertical but for rounding, the Z axis has no part in it: as with the exactly vertical direction.
        straight = rotated_fiber(np.tile([0.0, 0.0, upward], (len(tilt), 1)), np.linspace(-1.0, 1.0, len(tilt)))
        np.testing.assert_allclose(fiber[:3], straight[:3], atol=1e-8)
