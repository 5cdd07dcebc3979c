"""If these fail, the pressure in a cavity pushes the wall with the wrong force, or does not follow it."""

from collections.abc import Callable

import numpy as np
import pytest
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.cavity_pressure import CavityPressure
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver
from cardiac_cosim.units.mechanics.solvers.equilibrium import Convergence, Equilibrium
from cardiac_cosim.units.mechanics.solvers.factored import Factored
from cardiac_cosim.units.mesh import Mesh
from scipy.integrate import solve_bvp
from scipy.optimize import fsolve

_ORDERS = pytest.mark.parametrize("order", [1, 2])


# --- energy, forces and stiffness ----------------------------------------------------------------------------------


def _middle(at: np.ndarray) -> np.ndarray:
    return (np.abs(at - 1.5) < 0.51).all(axis=1)


def _cup(at: np.ndarray) -> np.ndarray:
    return (np.abs(at[:, :2] - 1.5) < 0.51).all(axis=1) & (at[:, 2] > 0.99)


def _skewed(points: np.ndarray) -> np.ndarray:
    return points + 0.05 * np.sin(2.0 * points[:, [1, 2, 0]])


@pytest.fixture(scope="module")
def hollow(box) -> Mesh:
    """A cube with a closed hole in its middle."""
    grid = np.arange(4.0)
    return box(grid, grid, grid, keep=lambda at: ~_middle(at), mapped=_skewed, inside=_middle)


@pytest.fixture(scope="module")
def cup(box) -> Mesh:
    """A cube with a hole that is open at the top, `rim`, whose normal is the z axis."""
    grid = np.arange(4.0)

    def lid(at: np.ndarray) -> np.ndarray:
        return at[:, 2] > 2.99

    def bent(points: np.ndarray) -> np.ndarray:
        moved = _skewed(points)
        moved[:, 2] = points[:, 2]
        return moved

    return box(grid, grid, grid, keep=lambda at: ~_cup(at), mapped=bent, inside=lambda at: _cup(at) & ~lid(at), rim=lid)


def _deformed(points: np.ndarray) -> np.ndarray:
    """A smooth displacement, large enough that nothing is linear, and zero where z = 3."""
    wave = np.sin(points[:, [1, 2, 0]] + 0.3) + 0.2 * points[:, [2, 0, 1]]
    return 0.1 * (3.0 - points[:, 2:]) * wave


def _jacobian(load: CavityPressure, displacement: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Derivative of the forces by what is free; they are quadratic, so that central differences are exact."""
    columns = []
    for place in np.flatnonzero(free):
        step = np.zeros(displacement.size)
        step[place] = 0.1
        step = step.reshape(-1, 3)
        columns.append((load.forces(displacement + step) - load.forces(displacement - step)).ravel() / 0.2)
    return np.array(columns).T[free.ravel()]


def _assembled(load: CavityPressure, displacement: np.ndarray, free: np.ndarray) -> np.ndarray:
    matrix = np.zeros((displacement.size, displacement.size))
    degrees = (3 * load.nodes[:, :, None] + np.arange(3)).reshape(len(load.nodes), -1)
    blocks = load.stiffness(displacement).reshape(len(degrees), degrees.shape[1], -1)
    np.add.at(matrix, (degrees[:, :, None], degrees[:, None, :]), blocks)
    return matrix[np.ix_(free.ravel(), free.ravel())]


def _case(name: str, order: int, request: pytest.FixtureRequest) -> tuple[CavityPressure, np.ndarray, np.ndarray]:
    """The load, a displacement, and which degrees of freedom of its surface are free, shape (nodes, 3)."""
    mesh = request.getfixturevalue(name)
    space = ELEMENTS[order](mesh)
    load = CavityPressure(space, mesh.boundary("inside"))
    free = np.zeros((len(space.points), 3), dtype=bool)
    free[np.unique(load.nodes)] = True
    if name == "cup":
        free[space.points[:, 2] == 3.0] = False
    return load, _deformed(space.points), free


@_ORDERS
@pytest.mark.parametrize("name", ["hollow", "cup"])
def test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces(
    name: str, order: int, request: pytest.FixtureRequest, slopes
) -> None:
    load, displacement, free = _case(name, order, request)
    direction = np.where(free, np.random.default_rng(4).standard_normal(free.shape), 0.0)
    exact = float(np.sum(load.forces(displacement) * direction))
    steps = (0.2, 0.1, 0.05)
    errors = [
        abs((load.energy(displacement + s * direction) - load.energy(displacement - s * direction)) / (2.0 * s) - exact)
        for s in steps
    ]
    assert errors[-1] < 0.05 * abs(exact)
    # The energy is a cubic: the error is its third derivative and nothing else.
    np.testing.assert_allclose(slopes(steps, errors), 2.0, atol=1e-3)
    jacobian = _jacobian(load, displacement, free)
    # Symmetric before anybody makes it so: there is a potential.
    np.testing.assert_allclose(jacobian, jacobian.T, rtol=0.0, atol=1e-12 * np.abs(jacobian).max())
    np.testing.assert_allclose(
        _assembled(load, displacement, free), jacobian, rtol=0.0, atol=1e-12 * np.abs(jacobian).max()
    )


@_ORDERS
def test_with_a_rim_that_moves_there_is_no_potential_and_the_symmetric_part_is_given(
    order: int, request: pytest.FixtureRequest
) -> None:
    load, displacement, free = _case("cup", order, request)
    free[np.unique(load.nodes)] = True
    jacobian = _jacobian(load, displacement, free)
    assert np.abs(jacobian - jacobian.T).max() > 0.05 * np.abs(jacobian).max()
    np.testing.assert_allclose(
        _assembled(load, displacement, free),
        0.5 * (jacobian + jacobian.T),
        rtol=0.0,
        atol=1e-12 * np.abs(jacobian).max(),
    )


@_ORDERS
def test_the_volume_is_that_of_the_deformed_hole(order: int, box) -> None:
    grid = np.arange(4.0)
    mesh = box(grid, grid, grid, keep=lambda at: ~_middle(at), inside=_middle)
    space = ELEMENTS[order](mesh)
    load, at = CavityPressure(space, mesh.boundary("inside")), space.points
    assert load.volume(np.zeros_like(at)) == pytest.approx(1.0, rel=1e-12)
    stretched = at @ np.array([[1.1, 0.2, 0.0], [0.0, 0.9, 0.1], [0.3, 0.0, 1.2]]).T + [5.0, -3.0, 2.0] - at
    assert load.volume(stretched) == pytest.approx(np.linalg.det([[1.1, 0.2, 0], [0, 0.9, 0.1], [0.3, 0, 1.2]]))
    if order == 2:
        # z' = z (1 + x² y²/10) on the unit cube of the hole, quadratic on each edge only by x: ∫ 1 + x²/10 = 1 + 1/30.
        bent = np.zeros_like(at)
        bent[:, 2] = (at[:, 2] - 1.0) * (at[:, 0] - 1.0) ** 2 / 10.0
        flat = np.isin(at[:, 2], (1.0, 2.0))
        bent[~flat, 2] = 0.0
        assert load.volume(bent) == pytest.approx(1.0 + 1.0 / 30.0, rel=1e-12)


# --- closed forms --------------------------------------------------------------------------------------------------

_SHEAR, _LAMBDA = 0.2, 0.5


def _nominal(along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """∂W/∂λ of the neo-Hookean solid in MPa, of one stretch and of either of two others that are equal."""
    log = np.log(along * across**2)
    first, second = (_SHEAR * (λ - 1.0 / λ) + _LAMBDA * log / λ for λ in (along, across))
    return first, second


@_ORDERS
def test_a_block_under_pressure_is_the_closed_form(order: int, box, solid_of) -> None:
    # Uniaxial: no stress across, and −p on the deformed top, whose area has grown by λ_t².
    pressure = 0.15
    along, across = fsolve(lambda λ: [_nominal(*λ)[0] + pressure * λ[1] ** 2, _nominal(*λ)[1]], (0.9, 1.05), xtol=1e-14)
    grid = np.linspace(0.0, 1.0, 3)
    mesh = box(grid, grid, grid, top=lambda at: at[:, 2] > 0.99)
    solid = solid_of(
        mesh,
        (NeoHooke(),),
        order,
        lambda at: at > 1e-9,
        pressures=[lambda space: CavityPressure(space, mesh.boundary("top"))],
    )
    loads = np.append(np.zeros(mesh.nodes), pressure)
    displacement = solid.space.points * ([across, across, along] - np.ones(3))
    assert np.abs(solid.residual(displacement, loads)).max() < 1e-13
    # One that did not follow would be in equilibrium elsewhere: the area has grown by 5 %.
    assert across**2 > 1.05
    loads[-1] = pressure / across**2
    assert np.abs(solid.residual(displacement, loads)).max() > 1e-4


_INNER, _OUTER, _PRESSURE = 10.0, 15.0, 0.04


def _octant(around: int, through: int) -> Mesh:
    """The eighth of a spherical shell in which all coordinates are positive; its inner surface is `inside`."""
    corners = np.array([(i, j) for i in range(around + 1) for j in range(around + 1 - i)])
    number = {tuple(pair): place for place, pair in enumerate(corners.tolist())}
    triangles = [[number[i, j], number[i + 1, j], number[i, j + 1]] for i, j in corners.tolist() if i + j < around] + [
        [number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]] for i, j in corners.tolist() if i + j < around - 1
    ]
    plane = np.column_stack([corners, around - corners.sum(axis=1)]).astype(float)
    sphere = plane / np.linalg.norm(plane, axis=1)[:, None]
    radii = np.linspace(_INNER, _OUTER, through + 1)
    points = (radii[:, None, None] * sphere).reshape(-1, 3)
    lower = np.sort(triangles, axis=1)
    cells = []
    for shell in range(through):
        a, b = (lower + layer * len(sphere) for layer in (shell, shell + 1))
        # Prisms in three tetrahedra each, in the order of the nodes, so that neighbours agree on their diagonals.
        cells += [
            np.column_stack([a[:, 0], a[:, 1], a[:, 2], b[:, 2]]),
            np.column_stack([a[:, 0], a[:, 1], b[:, 1], b[:, 2]]),
            np.column_stack([a[:, 0], b[:, 0], b[:, 1], b[:, 2]]),
        ]
    stacked = np.concatenate(cells)
    inverted = np.linalg.det(points[stacked[:, 1:]] - points[stacked[:, :1]]) < 0.0
    stacked[inverted] = stacked[inverted][:, [0, 2, 1, 3]]
    return Mesh(points, stacked, {"inside": lower})


def _exact_inner_displacement(pressure_at: Callable[[float], float]) -> float:
    """u(R_inner) in mm of (R² P_r)' = 2 R P_t with P_r = 0 outside and P_r = −`pressure_at`(λ_t) inside."""

    def radial_stretch(radius: np.ndarray, at: np.ndarray) -> np.ndarray:
        # P_r(λ_r, λ_t) = given, by Newton's method: P_r grows with λ_r.
        λ_t, given = at[0] / radius, at[1]
        λ_r = np.ones_like(λ_t)
        for _ in range(60):
            slope = _SHEAR * (1.0 + λ_r**-2) + _LAMBDA * (1.0 - np.log(λ_r * λ_t**2)) / λ_r**2
            λ_r = λ_r - (_nominal_radial(λ_r, λ_t) - given) / slope
        return λ_r

    def _nominal_radial(λ_r: np.ndarray, λ_t: np.ndarray) -> np.ndarray:
        return _SHEAR * (λ_r - 1.0 / λ_r) + _LAMBDA * np.log(λ_r * λ_t**2) / λ_r

    def rates(radius: np.ndarray, at: np.ndarray) -> np.ndarray:
        λ_r, λ_t = radial_stretch(radius, at), at[0] / radius
        tangential = _SHEAR * (λ_t - 1.0 / λ_t) + _LAMBDA * np.log(λ_r * λ_t**2) / λ_t
        return np.array([λ_r, -2.0 / radius * (at[1] - tangential)])

    def ends(inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
        return np.array([inside[1] + pressure_at(inside[0] / _INNER), outside[1]])

    radius = np.linspace(_INNER, _OUTER, 21)
    guess = np.array([radius + 0.5 * (_INNER / radius) ** 2, np.linspace(-_PRESSURE, 0.0, 21)])
    found = solve_bvp(rates, ends, radius, guess, tol=1e-10, max_nodes=100_000)
    assert found.success
    return float(found.sol(_INNER)[0] - _INNER)


def _inner_displacement(order: int, around: int, solid_of) -> float:
    """The mean radial displacement in mm of the inner surface's vertices."""
    mesh = _octant(around, around // 2)
    solid = solid_of(
        mesh,
        (NeoHooke(_SHEAR, _LAMBDA),),
        order,
        lambda at: at > 1e-9,
        pressures=[lambda space: CavityPressure(space, mesh.boundary("inside"))],
    )
    equilibrium = Equilibrium(solid, 1.0, Convergence(equilibrium_tolerance=1e-10), LinearSolver().factorisation(solid))
    rest, unloaded = np.zeros_like(solid.space.points), np.zeros(solid.loads)
    loads = np.append(unloaded[:-1], _PRESSURE)
    found = equilibrium.solve(rest, rest, unloaded, loads, Factored(rest, unloaded)).displacement
    nodes = np.unique(mesh.boundary("inside"))
    return float(np.mean(np.linalg.norm((solid.space.points + found)[nodes], axis=1)) - _INNER)


@_ORDERS
def test_a_thick_sphere_swells_to_the_exact_radius_at_second_order(order: int, solid_of, slopes) -> None:
    exact = _exact_inner_displacement(lambda stretch: _PRESSURE * stretch**2)
    dead = _exact_inner_displacement(lambda stretch: _PRESSURE)
    # Quadratic displacements on straight edges are less wrong, and of the order of the edges.
    counts = (5, 10, 20) if order == 1 else (3, 6, 12)
    errors = [abs(_inner_displacement(order, around, solid_of) - exact) for around in counts]
    orders = slopes([1.0 / around for around in counts], errors)
    # Outwards, and well beyond small strains, where a load that does not follow is told from one that does.
    assert exact > 0.1 * _INNER
    assert exact - dead > 10.0 * errors[-1]
    assert errors[-1] < 0.01 * exact
    assert ((orders > 1.65) & (orders < 2.1)).all(), orders


# --- the unit ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chambers(two_chambers, frames) -> tuple[Mesh, dict[str, np.ndarray]]:
    fiber, sheet = frames(two_chambers.elements)
    return two_chambers, {"fiber": fiber, "sheet": sheet}


@_ORDERS
@pytest.mark.parametrize(("side", "other"), [("lv", "rv"), ("rv", "lv")])
def test_a_pressure_fills_its_own_ventricle(side: str, other: str, order: int, chambers, started) -> None:
    mesh, directions = chambers
    unit = started(Mechanics, mesh, {"element_order": order}, **directions)
    before = {name: float(unit.get(f"{name}_volume")) for name in ("lv", "rv")}
    grown = []
    for level in (5.0, 10.0):
        unit.set(f"{side}_pressure", level)
        unit.do_step(0.0, 0.001)
        grown.append(float(unit.get(f"{side}_volume")) - before[side])
        assert abs(float(unit.get(f"{other}_volume")) - before[other]) < 0.5 * grown[-1]
    assert 0.0 < 1.8 * grown[0] < grown[1]
    unit.set(f"{side}_pressure", -5.0)
    unit.do_step(0.001, 0.001)
    assert float(unit.get(f"{side}_volume")) < before[side]


def test_no_pressure_is_the_same_to_the_bit_as_one_of_zero(chambers, started) -> None:
    mesh, directions = chambers
    plain, connected = (started(Mechanics, mesh, **directions) for _ in range(2))
    for level in (50.0, 120.0):
        for unit in (plain, connected):
            unit.set("active_stress", np.full(mesh.nodes, level))
        for name in ("lv_pressure", "rv_pressure"):
            connected.set(name, 0.0)
        for unit in (plain, connected):
            unit.do_step(0.0, 0.001)
        for name in ("displacement", "stretch", "lv_volume", "rv_volume"):
            assert plain.get(name).tobytes() == connected.get(name).tobytes()


def test_a_kilopascal_in_the_unit_is_a_kilopascal_in_the_solid(chambers, started, solid_of) -> None:
    # A thousandfold pressure would push the right way, too.
    mesh, directions = chambers
    unit = started(Mechanics, mesh, lv_pressure=8.0, **directions)
    base = mesh.boundary_nodes("base")
    solid = solid_of(
        mesh,
        (NeoHooke(), HolzapfelFiber()),
        free=lambda at: np.isin(np.arange(len(at)), base, invert=True)[:, None].repeat(3, axis=1),
        directions=(directions["fiber"], directions["sheet"]),
        pressures=[lambda space: CavityPressure(space, mesh.boundary("lv_endocardium"))],
    )
    loads = np.append(np.zeros(mesh.nodes), 0.008)
    left = np.abs(solid.residual(unit.get("displacement"), loads)).max()
    loads[-1] = 0.0081
    assert left < 1e-4 * np.abs(solid.residual(unit.get("displacement"), loads)).max()
