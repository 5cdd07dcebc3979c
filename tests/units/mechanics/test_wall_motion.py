"""If these fail, the heart's twist and strains, by which clinics judge its contraction, are not those of its motion."""

from collections.abc import Callable

import numpy as np
import pytest
from cardiac_cosim.fmus.annotations import annotations
from cardiac_cosim.orchestrator.participants.native import unit_ports
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import LocalMechanics, Mechanics
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.twist import Twist
from cardiac_cosim.units.mechanics.wall_motion import WallMotion
from cardiac_cosim.units.mechanics.wall_strain import WallStrain
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.lv_wall import lv_tissue, wall_directions

_STRAINS = ("radial_strain", "circumferential_strain", "longitudinal_strain")
_ALL = ("twist", *_STRAINS)
_LENGTH = 30.0

#: A map of points, shape (points, 3), to where they are after the deformation.
Motion = Callable[[np.ndarray], np.ndarray]


def _turned(points: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Turned about Z by `angle` in rad, counterclockwise as seen from above."""
    x, y, z = points.T
    return np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z], axis=1)


@pytest.fixture(scope="module")
def tube(box) -> Callable[[int], Mesh]:
    """A tube of 30 mm around the Z axis, below Z = 0, with a number of elements through its wall."""

    def make(through: int) -> Mesh:
        return box(
            np.linspace(10.0, 20.0, through + 1),
            np.linspace(0.0, 2.0 * np.pi, 12 * through + 1),
            # No node lies where a slice ends.
            np.linspace(-_LENGTH, 0.0, 4 * through + 1),
            mapped=lambda at: _turned(at * [1.0, 0.0, 1.0], at[:, 1]),
            lv_endocardium=lambda at: at[:, 0] < 10.0 + 1e-6,
        )

    return make


def _twist(mesh: Mesh, motion: Motion) -> float:
    return Twist(mesh, np.ones(mesh.elements, dtype=bool)).degrees(motion(mesh.points) - mesh.points)


# --- twist --------------------------------------------------------------------------------------------------------


def test_torsion_is_the_turn_between_the_middles_of_the_slices_to_second_order(tube, slopes) -> None:
    # 2 degrees per mm; the middles of the outer thirds are two thirds of the length apart.
    rate = np.deg2rad(2.0)
    exact = 2.0 * 2.0 * _LENGTH / 3.0
    through = (1, 2, 4)
    errors = [abs(_twist(tube(count), lambda at: _turned(at, rate * at[:, 2])) - exact) for count in through]
    assert errors[-1] < 2e-3 * exact
    assert (slopes([1.0 / count for count in through], errors) > 1.8).all(), errors


def test_twist_is_positive_where_the_apex_turns_counterclockwise_as_seen_from_the_apex(tube) -> None:
    mesh = tube(2)

    def upwards(at: np.ndarray) -> np.ndarray:
        # Whoever looks up from below with Y upwards sees −X on the right-hand side; what is there goes up.
        moved = at.copy()
        moved[(at[:, 0] < -9.0) & (at[:, 2] < -_LENGTH / 2.0), 1] += 1.0
        return moved

    assert _twist(mesh, upwards) > 0.0
    # A base that turns the other way adds to it.
    both = _twist(mesh, lambda at: _turned(at, np.where(at[:, 2] > -_LENGTH / 2.0, 0.1, -0.2)))
    assert both == pytest.approx(np.degrees(0.3), rel=1e-12)


def test_a_body_that_moves_as_a_whole_neither_twists_nor_strains(heart: Mesh) -> None:
    motion = WallMotion(heart, ELEMENTS[1](heart))
    for angle in (0.5, 3.0):
        moved = _turned(heart.points, angle) + np.array([3.0, -20.0, 5.0]) - heart.points
        for name in _ALL:
            assert motion.value(name, moved) == pytest.approx(0.0, abs=1e-11), name


def test_a_large_turn_of_all_of_it_takes_nothing_from_the_twist(tube) -> None:
    mesh = tube(2)
    torsion = _twist(mesh, lambda at: _turned(at, 0.02 * at[:, 2]))
    # Beyond 180 degrees an angle begins anew, a difference of two must not.
    for turn in (2.0, 3.1, 3.2, 4.0):
        whole = _twist(mesh, lambda at, turn=turn: _turned(_turned(at, 0.02 * at[:, 2]), turn))
        assert whole == pytest.approx(torsion, abs=1e-10)


def test_squeezing_swelling_and_leaning_do_not_twist(tube) -> None:
    mesh = tube(2)
    assert _twist(mesh, lambda at: at * [0.7, 0.9, 0.8]) == pytest.approx(0.0, abs=1e-10)
    # What the diagonals of the mesh, which all lean one way, make of a cone.
    assert _twist(mesh, lambda at: at * (1.0 + 0.005 * at[:, 2:])) == pytest.approx(0.0, abs=0.01)
    assert _twist(mesh, lambda at: at + np.outer(at[:, 2], [0.2, -0.1, 0.0])) == pytest.approx(0.0, abs=1e-10)


def test_a_coarse_heart_twists_like_a_fine_one(small_heart: Mesh, heart: Mesh) -> None:
    def torsion(at: np.ndarray) -> np.ndarray:
        return _turned(at, np.deg2rad(0.2) * at[:, 2])

    coarse, fine = (
        Twist(mesh, lv_tissue(mesh)).degrees(torsion(mesh.points) - mesh.points) for mesh in (small_heart, heart)
    )
    assert coarse == pytest.approx(fine, rel=0.02)
    # The cavity is 58 mm long.
    assert fine == pytest.approx(0.2 * 58.0 * 2.0 / 3.0, rel=0.05)


# --- strains ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2])
def test_a_homogeneous_stretch_is_exact(two_chambers: Mesh, along, order: int) -> None:
    space = ELEMENTS[order](two_chambers)
    everywhere = np.ones(two_chambers.elements, dtype=bool)
    for direction, stretch in (((1, 0, 0), 1.2), ((0, 1, 0), 0.9), ((0, 0, 1), 1.0), ((0, 0.6, 0.8), None)):
        strain = WallStrain(space, everywhere, along(two_chambers, direction))
        found = strain.mean(space.points * [0.2, -0.1, 0.0])
        exact = 0.36 * 0.5 * (0.9**2 - 1.0) if stretch is None else 0.5 * (stretch**2 - 1.0)
        assert found == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize("order", [1, 2])
def test_strains_are_the_mean_of_the_green_lagrange_strain_over_the_left_ventricle(heart: Mesh, order: int) -> None:
    space = ELEMENTS[order](heart)
    gradient = np.random.default_rng(3).uniform(-0.3, 0.3, (3, 3))
    strain = 0.5 * ((np.eye(3) + gradient).T @ (np.eye(3) + gradient) - np.eye(3))
    motion, tissue = WallMotion(heart, space), lv_tissue(heart)
    found = {name: motion.value(name, space.points @ gradient.T) for name in _STRAINS}
    for name, direction in wall_directions(heart).items():
        normal = np.einsum("ei,ij,ej->e", direction, strain, direction)
        mean = float(heart.volumes[tissue] @ normal[tissue] / heart.volumes[tissue].sum())
        assert found[f"{name}_strain"] == pytest.approx(mean, abs=1e-13), name
    assert sum(found.values()) == pytest.approx(np.trace(strain), abs=1e-13)


def test_only_the_left_ventricles_tissue_counts(two_chambers: Mesh) -> None:
    motion = WallMotion(two_chambers, ELEMENTS[1](two_chambers))
    moved = np.random.default_rng(5).normal(size=two_chambers.points.shape)
    own = np.unique(two_chambers.cells[lv_tissue(two_chambers)])
    others = np.setdiff1d(np.arange(two_chambers.nodes), own)
    assert len(others) > 50
    before = {name: motion.value(name, moved) for name in _ALL}
    moved[others] += 10.0
    assert {name: motion.value(name, moved) for name in _ALL} == before


def test_a_wall_that_is_pressed_together_strains_to_second_order(tube, slopes) -> None:
    # r -> sqrt(r^2 - 36), z kept: no volume is lost, so that the wall thickens while its circumference shortens.
    def emptied(at: np.ndarray) -> np.ndarray:
        radius = np.linalg.norm(at[:, :2], axis=1)
        return at * np.stack([np.sqrt(radius**2 - 36.0) / radius] * 2 + [np.ones_like(radius)], axis=1)

    # Means over the ring 10..20 of 1/2 (r^2/(r^2 - 36) - 1) and 1/2 ((r^2 - 36)/r^2 - 1), weighted by r.
    exact = {"radial": 18.0 * np.log(364.0 / 64.0) / 300.0, "circumferential": -18.0 * np.log(4.0) / 300.0}
    errors: dict[str, list[float]] = {name: [] for name in exact}
    through = (2, 4, 8)
    for count in through:
        mesh = tube(count)
        axis = mesh.centroids * [1.0, 1.0, 0.0]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        directions = {"radial": axis, "circumferential": np.cross([0.0, 0.0, 1.0], axis)}
        for name, direction in directions.items():
            strain = WallStrain(ELEMENTS[1](mesh), np.ones(mesh.elements, dtype=bool), direction)
            errors[name].append(abs(strain.mean(emptied(mesh.points) - mesh.points) - exact[name]))
    for name, found in errors.items():
        assert (slopes([1.0 / count for count in through], found) > 1.7).all(), (name, found)


# --- the unit -----------------------------------------------------------------------------------------------------


def test_at_rest_there_is_none_of_them(small_heart: Mesh, started) -> None:
    fibers = started(FiberGenerator, small_heart)
    unit = started(Mechanics, small_heart, **{name: fibers.get(name) for name in ("fiber", "sheet")})
    unit.do_step(0.0, 1e-3)
    assert [float(unit.get(name)) for name in _ALL] == [0.0] * 4


def test_fibres_of_a_healthy_heart_wring_it_out_counterclockwise_and_mirrored_ones_clockwise(
    small_heart: Mesh, started
) -> None:
    twists = []
    for inner in (60.0, -60.0):
        fibers = started(FiberGenerator, small_heart, {"endocardial_angle_deg": inner, "epicardial_angle_deg": -inner})
        directions = {name: fibers.get(name) for name in ("fiber", "sheet")}
        unit = started(Mechanics, small_heart, active_stress=np.full(small_heart.nodes, 200.0), **directions)
        twists.append(float(unit.get("twist")))
        assert unit.get("circumferential_strain") < -0.05
        assert unit.get("longitudinal_strain") < -0.005
    assert 2.0 < twists[0] < 15.0
    assert -15.0 < twists[1] < -2.0


def test_sheets_in_other_directions_do_not_change_what_is_radial(small_heart: Mesh, started) -> None:
    # Without active stress across the fibres, sheets that are not given have no influence on the motion.
    fibers = started(FiberGenerator, small_heart)
    shares = {"active_share_sheet": 0.0, "active_share_normal": 0.0, "material": "neo_hooke"}
    stress, fiber = np.full(small_heart.nodes, 50.0), fibers.get("fiber")
    given = started(Mechanics, small_heart, shares, active_stress=stress, fiber=fiber, sheet=fibers.get("sheet"))
    without = started(Mechanics, small_heart, shares, active_stress=stress, fiber=fiber)
    for name in _ALL:
        assert without.get(name) == pytest.approx(given.get(name), rel=1e-6, abs=1e-9), name


def test_scenes_without_a_left_ventricle_have_no_columns_of_zeros(small_heart: Mesh, started) -> None:
    def recorded(unit: type, mesh: Mesh) -> set[str]:
        _, outputs = unit_ports(unit.name, mesh, {})
        told = "\n".join(annotations(unit, mesh))
        columns = {name for name in _ALL if outputs[name].record == "value"}
        # The FMU says the same.
        assert columns == {name for name in _ALL if f'name="{name}" location="global" fixed="false" record=' in told}
        return columns

    slab = build("slab", 6.0)
    assert recorded(Mechanics, small_heart) == set(_ALL)
    assert recorded(Mechanics, slab) == recorded(LocalMechanics, small_heart) == set()
    fibers = started(FiberGenerator, slab)
    directions = {name: fibers.get(name) for name in ("fiber", "sheet")}
    unit = started(Mechanics, slab, active_stress=np.full(slab.nodes, 50.0), **directions)
    assert unit.get("displacement").any()
    assert [float(unit.get(name)) for name in _ALL] == [0.0] * 4
