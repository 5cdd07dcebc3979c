"""If these fail, the contracting heart moves wrongly: wrong volumes, wrong stretch, or memory of a past."""

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mechanics.bulk import Tissue
from cardiac_cosim.units.mechanics.elements.linear import linear
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares
from cardiac_cosim.units.mechanics.solid import Solid
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver
from cardiac_cosim.units.mechanics.solvers.equilibrium import Convergence, Equilibrium
from cardiac_cosim.units.mechanics.solvers.factored import Factored, Factors, NotConverged
from cardiac_cosim.units.mechanics.solvers.newton import Newton
from cardiac_cosim.units.mesh import Mesh
from manufactured import FIBER, SHEET, body_force, exact, exact_tension
from scipy.optimize import fsolve
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

_LAWS = (NeoHooke(), HolzapfelFiber())
_NOTHING = np.array([], dtype=int)


def _solid(mesh: Mesh, fiber: np.ndarray, sheet: np.ndarray, fixed: np.ndarray = _NOTHING) -> Solid:
    free = np.ones((mesh.nodes, 3), dtype=bool)
    free[fixed] = False
    return Solid(linear(mesh), Tissue(fiber, sheet, _LAWS, ActiveShares().tensor(fiber, sheet)), free)


def _equilibrium(solid: Solid, convergence: Convergence) -> Equilibrium:
    return Equilibrium(solid, 1.0, convergence, LinearSolver().factorisation(solid))


def _frames(elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Random fibres and sheets."""
    frames = Rotation.random(elements, rng=12).as_matrix()
    return frames[:, 0], frames[:, 1]


@pytest.fixture(scope="module")
def cube(box) -> Mesh:
    """Eight hexahedra of a cube of 2 mm around one inner node, that node and others moved off the grid."""

    def distorted(points: np.ndarray) -> np.ndarray:
        return points + 0.06 * np.sin(3.0 * points[:, [1, 2, 0]] + 1.0)

    return box([0, 1, 2], [0, 1, 2], [0, 1, 2], mapped=distorted)


# --- the discretised solid -----------------------------------------------------------------------------------------


def _state(solid: Solid, mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(13)
    displacement = np.where(solid.free, random.uniform(-0.1, 0.1, (mesh.nodes, 3)), 0.0)
    direction = np.where(solid.free, random.standard_normal((mesh.nodes, 3)), 0.0)
    return displacement, direction, random.uniform(0.0, 0.5, mesh.nodes)


def test_residual_is_the_gradient_of_the_energy(cube, slopes) -> None:
    solid = _solid(cube, *_frames(cube.elements), np.arange(4))
    displacement, direction, tension = _state(solid, cube)
    exact = solid.residual(displacement, tension) @ direction[solid.free]
    steps = [4e-4, 2e-4, 1e-4]
    errors = [
        abs(
            (solid.energy(displacement + s * direction, tension) - solid.energy(displacement - s * direction, tension))
            / (2.0 * s)
            - exact
        )
        for s in steps
    ]
    assert errors[-1] < 1e-4 * abs(exact)
    orders = slopes(steps, errors)
    assert ((orders > 1.9) & (orders < 2.1)).all(), orders


def test_tangent_is_the_derivative_of_the_residual(cube, slopes) -> None:
    solid = _solid(cube, *_frames(cube.elements), np.arange(4))
    displacement, direction, tension = _state(solid, cube)
    tangent = solid.tangent(displacement, tension).full()
    exact = tangent @ direction[solid.free]
    steps = [4e-4, 2e-4, 1e-4]
    errors = [
        np.abs(
            (
                solid.residual(displacement + s * direction, tension)
                - solid.residual(displacement - s * direction, tension)
            )
            / (2.0 * s)
            - exact
        ).max()
        for s in steps
    ]
    assert errors[-1] < 1e-4 * np.abs(exact).max()
    orders = slopes(steps, errors)
    assert ((orders > 1.9) & (orders < 2.1)).all(), orders
    assert abs(tangent - tangent.T).max() < 1e-12 * abs(tangent).max()


def test_inverted_element_has_infinite_energy(cube) -> None:
    solid = _solid(cube, *_frames(cube.elements))
    assert np.isfinite(solid.energy(-0.99 * cube.points, np.zeros(cube.nodes)))
    assert solid.energy(-1.01 * cube.points, np.zeros(cube.nodes)) == np.inf


def test_linear_displacement_is_reproduced(cube, along) -> None:
    gradient = np.array([[0.1, 0.05, -0.02], [0.03, -0.1, 0.04], [0.0, 0.02, 0.06]])
    fiber, sheet = _frames(cube.elements)
    solid = _solid(cube, fiber, sheet)
    displacement = cube.points @ gradient.T + [1.0, -2.0, 0.5]
    deformation = np.eye(3) + gradient
    np.testing.assert_allclose(solid.stretch(displacement), np.linalg.norm(fiber @ deformation.T, axis=1), rtol=1e-12)
    np.testing.assert_allclose(solid.volume_ratio(displacement), np.linalg.det(deformation), rtol=1e-12)


def test_patch_of_constant_stress_has_no_force_inside(cube, along) -> None:
    # The inner node moves with the linear field and nothing pulls at it; at the surface the traction shows.
    gradient = np.array([[0.1, 0.05, -0.02], [0.03, -0.1, 0.04], [0.0, 0.02, 0.06]])
    solid = _solid(cube, along(cube, (0.6, 0.8, 0)), along(cube, (0, 0, 1)))
    force = solid.residual(cube.points @ gradient.T, np.full(cube.nodes, 0.3)).reshape(-1, 3)
    inner = np.setdiff1d(np.arange(cube.nodes), cube.surface)
    assert len(inner) == 1
    outer = np.delete(np.linalg.norm(force, axis=1), inner)
    assert np.linalg.norm(force[inner]) < 1e-13
    assert np.median(outer) > 1e-2


def test_patch_is_found_by_the_equilibrium(cube, along) -> None:
    # The same seen by the solver: with the surface held in place, constant active stress leaves the inner node there.
    inner = np.setdiff1d(np.arange(cube.nodes), cube.surface)
    solid = _solid(cube, along(cube, (0.6, 0.8, 0)), along(cube, (0, 0, 1)), np.unique(cube.surface))
    rest, tension = np.zeros((cube.nodes, 3)), np.full(cube.nodes, 0.3)
    guess = rest.copy()
    guess[inner] = [0.2, -0.1, 0.15]
    found = _equilibrium(solid, Convergence(equilibrium_tolerance=1e-12)).solve(
        rest, guess, tension, tension, Factored(rest, np.zeros(cube.nodes))
    )
    np.testing.assert_allclose(found.displacement, 0.0, atol=1e-11)


def test_the_last_iterate_of_newtons_method_counts(cube, along, monkeypatch: pytest.MonkeyPatch) -> None:
    # It could meet the limit and be called a failure: of n iterations n steps are taken, and n + 1 residuals looked at.
    inner = np.setdiff1d(np.arange(cube.nodes), cube.surface)
    solid = _solid(cube, along(cube, (0.6, 0.8, 0)), along(cube, (0, 0, 1)), np.unique(cube.surface))
    tension, moved = np.full(cube.nodes, 0.3), np.zeros((cube.nodes, 3))
    moved[inner] = [0.2, -0.1, 0.15]
    steps: list[int] = []

    def solve(iterations: int) -> None:
        newton = Newton(solid, Factors(solid, LinearSolver().factorisation(solid)), 1e-10, iterations)
        search = newton.search
        monkeypatch.setattr(newton, "search", lambda *given: (steps.append(1), search(*given))[1])
        newton.solve(moved, tension, Factored(moved, tension))

    solve(25)
    needed = len(steps)
    assert needed > 2
    solve(needed)
    with pytest.raises(NotConverged, match=f"after {needed - 1} iterations"):
        solve(needed - 1)


def test_rigid_motion_costs_nothing(cube) -> None:
    solid = _solid(cube, *_frames(cube.elements))
    turn = Rotation.from_rotvec([0.5, -1.0, 2.0]).as_matrix()
    displacement = cube.points @ turn.T + [3.0, 2.0, 1.0] - cube.points
    assert abs(solid.energy(displacement, np.zeros(cube.nodes))) < 1e-13
    np.testing.assert_allclose(solid.residual(displacement, np.zeros(cube.nodes)), 0.0, atol=1e-13)
    np.testing.assert_allclose(solid.stretch(displacement), 1.0, rtol=1e-13)


# --- free contraction of a homogeneous cube ------------------------------------------------------------------------

#: s_a in MPa: stretch along and across the fibre, and J, by an independent computation (docs/model.md, Numbers to
#: verify against).
_CONTRACTION = {0.5: (0.73626, 0.97398, 0.698), 0.1: (0.90157, 1.00799, 0.91604)}


def _closed_form(tension: float) -> tuple[float, float]:
    """λ_f, λ_t with no stress: S_11 = μ(1 − 1/λ_f²) + λ_L ln J/λ_f² + s_a = 0, S_22 the same with 0.4 s_a.

    The fibre is slack (Ī_a < 1), which the caller checks.
    """

    def stresses(stretches: np.ndarray) -> list[float]:
        log = np.log(stretches[0] * stretches[1] ** 2)
        return [
            0.2 * (1.0 - stretch**-2) + 0.5 * log * stretch**-2 + share * tension
            for stretch, share in zip(stretches, (1.0, 0.4), strict=True)
        ]

    solution = fsolve(stresses, (0.8, 1.0), xtol=1e-13)
    return float(solution[0]), float(solution[1])


@pytest.mark.parametrize("tension", [0.5, 0.1])
def test_closed_form_of_free_contraction_is_the_figure(tension: float) -> None:
    fiber, across = _closed_form(tension)
    assert (fiber, across) == pytest.approx(_CONTRACTION[tension][:2], abs=6e-6)
    assert fiber * across**2 == pytest.approx(_CONTRACTION[tension][2], abs=5e-4 if tension == 0.5 else 1e-5)
    assert (fiber * across**2) ** (-2.0 / 3.0) * fiber**2 < 1.0


@pytest.mark.parametrize("tension", [0.5, 0.1])
def test_free_contraction_is_a_minimum_of_the_solids_energy(tension: float, cube, along) -> None:
    solid = _solid(cube, along(cube, (0, 1, 0)), along(cube, (0, 0, 1)))
    fiber, across = _closed_form(tension)
    displacement = cube.points * [across - 1.0, fiber - 1.0, across - 1.0]
    active = np.full(cube.nodes, tension)
    assert np.abs(solid.residual(displacement, active)).max() < 1e-12
    assert np.abs(solid.residual(0.99 * displacement, active)).max() > 1e-4
    # The six rigid motions cost nothing, everything else does.
    modes = np.linalg.eigvalsh(solid.tangent(displacement, active).full().toarray())
    assert np.abs(modes[:6]).max() < 1e-10
    assert modes[6] > 1e-3
    np.testing.assert_allclose(solid.stretch(displacement), fiber, rtol=1e-12)


@pytest.mark.parametrize("tension", [0.5, 0.1])
def test_free_cube_contracts_to_the_closed_form(tension: float, box, along) -> None:
    # `Solid` fixes whole nodes only, which hinders contraction: so Newton's method here, with the solid's residual
    # and tangent, and the rigid motions taken out by the pseudo-inverse.
    mesh = box([0, 1, 2], [0, 1], [0, 1])
    solid = _solid(mesh, along(mesh, (1, 0, 0)), along(mesh, (0, 0, 1)))
    active, displacement = np.full(mesh.nodes, tension), np.zeros((mesh.nodes, 3))
    for _ in range(30):
        residual = solid.residual(displacement, active)
        if np.abs(residual).max() < 1e-13:
            break
        step = np.linalg.lstsq(solid.tangent(displacement, active).full().toarray(), -residual, rcond=1e-9)[0]
        displacement = displacement + min(1.0, 0.1 / np.abs(step).max()) * step.reshape(-1, 3)
    assert np.abs(solid.residual(displacement, active)).max() < 1e-12
    figures = _CONTRACTION[tension]
    np.testing.assert_allclose(solid.stretch(displacement), figures[0], atol=6e-6)
    np.testing.assert_allclose(solid.volume_ratio(displacement), figures[0] * figures[1] ** 2, atol=2e-5)


# --- convergence under refinement ----------------------------------------------------------------------------------


def _l2_error(cells: int, box, along) -> float:
    """Distance in L2 of the discrete solution from the manufactured one, all surface nodes prescribed."""
    axis = np.linspace(0.0, 1.0, cells + 1)
    mesh = box(axis, axis, axis)
    fiber, sheet = along(mesh, FIBER), along(mesh, SHEET)
    surface = np.unique(mesh.surface)
    solid = _solid(mesh, fiber, sheet, surface)
    # Four-point rule of degree 2, shape functions at its points.
    shape = np.full((4, 4), 0.1381966011250105) + 0.4472135954999579 * np.eye(4)
    load = np.zeros((mesh.nodes, 3))
    for weights in shape:
        at = np.einsum("a,eai->ei", weights, mesh.points[mesh.cells])
        density = 0.25 * mesh.volumes[:, None] * body_force(at)
        for node in range(4):
            np.add.at(load, mesh.cells[:, node], weights[node] * density)
    tension = exact_tension(mesh.points)
    displacement = exact(mesh.points)
    displacement[np.setdiff1d(np.arange(mesh.nodes), surface)] *= 0.8
    for _ in range(20):
        residual = solid.residual(displacement, tension) - load[solid.free]
        if np.abs(residual).max() < 1e-12:
            break
        displacement[solid.free] -= spsolve(solid.tangent(displacement, tension).full(), residual)
    assert np.abs(residual).max() < 1e-12
    square = 0.0
    for weights in shape:
        at = np.einsum("a,eai->ei", weights, mesh.points[mesh.cells])
        off = np.einsum("a,eai->ei", weights, displacement[mesh.cells]) - exact(at)
        square += 0.25 * mesh.volumes @ np.sum(off**2, axis=1)
    return float(np.sqrt(square))


def test_displacement_converges_at_second_order(box, along, slopes) -> None:
    # Manufactured: a smooth finite deformation under varying active stress, with the body force that it needs.
    cells = [4, 8, 12]
    errors = [_l2_error(count, box, along) for count in cells]
    orders = slopes([1.0 / count for count in cells], errors)
    assert ((orders > 1.85) & (orders < 2.2)).all(), orders


@pytest.fixture(scope="module")
def block(box, along):
    """The unit's parts for a block that hangs from its base and contracts: mesh and directions."""

    def make(cells: int) -> tuple[Mesh, dict[str, np.ndarray]]:
        axis = np.linspace(0.0, 10.0, cells + 1)
        mesh = box(
            axis,
            axis,
            axis - 10.0,
            base=lambda at: at[:, 2] > -0.01,
            endocardium=lambda at: at[:, 1] < 0.01,
        )
        return mesh, {"fiber": along(mesh, (0, 0.6, 0.8)), "sheet": along(mesh, (1, 0, 0))}

    return make


def test_clamped_block_converges_under_refinement(block, started, slopes) -> None:
    # The clamped edge is singular and costs the full order; a point far from it still has to converge faster than
    # at first order: the change from mesh to mesh, each of half the size, more than halves.
    def uplift(cells: int) -> float:
        mesh, directions = block(cells)
        unit = started(Mechanics, mesh, active_stress=np.full(mesh.nodes, 100.0), **directions)
        corner = np.argmin(np.linalg.norm(mesh.points - [5.0, 5.0, -10.0], axis=1))
        return float(unit.get("displacement")[corner, 2])

    values = [uplift(cells) for cells in (2, 4, 8)]
    assert all(value > 0.5 for value in values)
    assert abs(values[2] - values[1]) < 0.5 * abs(values[1] - values[0])


# --- the unit ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chambers(two_chambers) -> tuple[Mesh, dict[str, np.ndarray]]:
    fiber, sheet = _frames(two_chambers.elements)
    return two_chambers, {"fiber": fiber, "sheet": sheet}


def _stress(mesh: Mesh, largest_kPa: float) -> np.ndarray:
    """Active stress that varies over the mesh."""
    return largest_kPa * (0.6 + 0.4 * np.sin(0.2 * mesh.points[:, 0] + 0.1 * mesh.points[:, 2]))


def test_unloaded_tissue_stays_undeformed(chambers, started) -> None:
    mesh, directions = chambers
    unit = started(Mechanics, mesh, **directions)
    unit.do_step(0.0, 0.001)
    assert not unit.get("displacement").any()
    # Below the stretch at which resting tissue fires (3.3e-5) by far.
    np.testing.assert_allclose(unit.get("stretch"), 1.0, atol=1e-14)
    assert unit.get("lv_volume") == pytest.approx(1.0, rel=1e-12)
    assert unit.get("rv_volume") == pytest.approx(1.0, rel=1e-12)
    assert unit.get("apex_uplift") == 0.0


def test_initial_active_stress_is_in_equilibrium_from_the_start(chambers, started) -> None:
    mesh, directions = chambers
    stress = _stress(mesh, 60.0)
    at_start = started(Mechanics, mesh, active_stress=stress, **directions)
    stepped = started(Mechanics, mesh, **directions)
    stepped.set("active_stress", stress)
    stepped.do_step(0.0, 0.001)
    assert np.abs(at_start.get("displacement")).max() > 0.1
    np.testing.assert_allclose(stepped.get("displacement"), at_start.get("displacement"), atol=1e-6)


def test_base_does_not_move_and_outputs_agree_with_the_displacement(chambers, started) -> None:
    mesh, directions = chambers
    unit = started(Mechanics, mesh, active_stress=_stress(mesh, 100.0), **directions)
    displacement = unit.get("displacement")
    assert not displacement[mesh.boundary_nodes("base")].any()
    lowest = mesh.points[:, 2].argmin()
    assert unit.get("apex_uplift") == displacement[lowest, 2]
    # F from the edges of each element.
    edges = mesh.points[mesh.cells[:, 1:]] - mesh.points[mesh.cells[:, :1]]
    moved = edges + displacement[mesh.cells[:, 1:]] - displacement[mesh.cells[:, :1]]
    gradient = (np.linalg.inv(edges) @ moved).transpose(0, 2, 1)
    stretch = np.linalg.norm(np.einsum("eij,ej->ei", gradient, directions["fiber"]), axis=1)
    assert stretch.min() < 0.95
    np.testing.assert_allclose(unit.get("stretch"), stretch, rtol=1e-10)


def test_unit_is_in_equilibrium(chambers, started) -> None:
    mesh, directions = chambers
    stress = _stress(mesh, 200.0)
    unit = started(Mechanics, mesh, active_stress=stress, **directions)
    solid = _solid(mesh, directions["fiber"], directions["sheet"], mesh.boundary_nodes("base"))
    residual = solid.residual(unit.get("displacement"), 1e-3 * stress)
    limit = 1e-6 * 0.2 * mesh.volumes.mean() ** (2.0 / 3.0)
    assert np.abs(residual).max() <= limit
    assert np.abs(solid.residual(np.zeros((mesh.nodes, 3)), 1e-3 * stress)).max() > 1e6 * limit


def test_mechanics_has_no_memory_and_a_jump_is_the_gradual_path(chambers, started) -> None:
    mesh, directions = chambers
    ends = []
    for path in ([500.0], list(np.linspace(25.0, 500.0, 20)), [650.0, 0.0, 500.0]):
        unit = started(Mechanics, mesh, **directions)
        for number, level in enumerate(path):
            unit.set("active_stress", _stress(mesh, level))
            unit.do_step(0.001 * number, 0.001)
        ends.append(unit)
    assert np.abs(ends[0].get("displacement")).max() > 1.0
    for other in ends[1:]:
        np.testing.assert_allclose(other.get("displacement"), ends[0].get("displacement"), rtol=0.0, atol=1e-5)
        np.testing.assert_allclose(other.get("stretch"), ends[0].get("stretch"), rtol=0.0, atol=1e-6)


def test_heart_takes_half_a_megapascal_in_one_step(heart, started) -> None:
    # On the fibres of its own generator: one jump to the plateau ends where five steps up to it end.
    fibers = started(FiberGenerator, heart)
    directions = {name: fibers.get(name) for name in ("fiber", "sheet")}
    jump = started(Mechanics, heart, **directions)
    before = jump.get("lv_volume")
    jump.set("active_stress", np.full(heart.nodes, 500.0))
    jump.do_step(0.0, 0.001)
    gradual = started(Mechanics, heart, **directions)
    for number in range(5):
        gradual.set("active_stress", np.full(heart.nodes, 100.0 * (number + 1)))
        gradual.do_step(0.001 * number, 0.001)
    assert jump.get("lv_volume") < 0.6 * before
    assert jump.get("apex_uplift") > 1.0
    np.testing.assert_allclose(gradual.get("displacement"), jump.get("displacement"), rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(gradual.get("stretch"), jump.get("stretch"), rtol=0.0, atol=1e-6)


def test_equilibrium_follows_its_input_in_a_step_of_zero(chambers, started) -> None:
    mesh, directions = chambers
    unit = started(Mechanics, mesh, **directions)
    unit.set("active_stress", _stress(mesh, 50.0))
    unit.do_step(0.0, 0.0)
    moved = unit.get("displacement")
    assert np.abs(moved).max() > 0.05
    unit.do_step(0.0, 0.0)
    np.testing.assert_array_equal(unit.get("displacement"), moved)


def test_tightening_the_tolerance_changes_nothing_that_matters(chambers, started) -> None:
    mesh, directions = chambers

    def stretch(tolerance: float) -> np.ndarray:
        unit = started(Mechanics, mesh, {"equilibrium_tolerance": tolerance}, **directions)
        for number, level in enumerate((100.0, 300.0, 500.0)):
            unit.set("active_stress", _stress(mesh, level))
            unit.do_step(0.001 * number, 0.001)
        return unit.get("stretch")

    tight = stretch(1e-13)
    assert np.abs(stretch(1e-8) - tight).max() < 1e-6
    # The parameter does something: a loose one leaves more.
    assert np.abs(stretch(9e-3) - tight).max() > 1e-6


def test_impossible_load_says_so_and_leaves_the_state(chambers, started) -> None:
    # A negative active stress pushes across the fibre: beyond -μ/0.4 = -500 kPa no stiffness holds it.
    mesh, directions = chambers
    unit = started(Mechanics, mesh, **directions)
    unit.set("active_stress", _stress(mesh, 100.0))
    unit.do_step(0.0, 0.001)
    before = unit.get_state()
    unit.set("active_stress", np.full(mesh.nodes, -5000.0))
    with pytest.raises(
        StepFailure, match=r"no equilibrium was found beyond \d+ % of the change .*largest is -5000 kPa"
    ):
        unit.do_step(0.001, 0.001)
    assert all(unit.get_state().state[name] is value for name, value in before.state.items())
    unit.set("active_stress", _stress(mesh, 100.0))
    unit.do_step(0.001, 0.001)


def test_step_after_a_failure_is_the_step_without_it(chambers, started) -> None:
    mesh, directions = chambers
    plain, failed = (started(Mechanics, mesh, active_stress=_stress(mesh, 100.0), **directions) for _ in range(2))
    failed.set("active_stress", np.full(mesh.nodes, -5000.0))
    with pytest.raises(StepFailure):
        failed.do_step(0.0, 0.001)
    for unit in (plain, failed):
        unit.set("active_stress", _stress(mesh, 200.0))
        unit.do_step(0.0, 0.001)
    assert plain.get("displacement").tobytes() == failed.get("displacement").tobytes()


def test_seeds_energy_has_no_state_to_start_from(chambers, started) -> None:
    mesh, directions = chambers
    with pytest.raises(StepFailure, match=r"stress of 0\.4 MPa although nothing loads it.*use neo_hooke_log_sign"):
        started(Mechanics, mesh, {"neo_hooke_log_sign": "as_printed"}, **directions)


@pytest.mark.parametrize("missing", ["base", "lv_endocardium", "rv_endocardium", "rv_septum"])
def test_missing_boundary_is_named(missing: str, chambers, started) -> None:
    mesh, directions = chambers
    rest = {name: faces for name, faces in mesh.boundaries.items() if name != missing}
    with pytest.raises(InvalidInput, match=f"no boundary named '{missing}'"):
        started(Mechanics, Mesh(mesh.points, mesh.cells, rest), **directions)


def test_sheet_that_is_not_normal_to_the_fibre_is_refused(chambers, started) -> None:
    mesh, directions = chambers
    tilted = directions["sheet"].copy()
    tilted[7] = tilted[7] + 1e-4 * directions["fiber"][7]
    tilted[7] /= np.linalg.norm(tilted[7])
    with pytest.raises(InvalidInput, match="'sheet' is not normal to the fibre in element 7"):
        started(Mechanics, mesh, fiber=directions["fiber"], sheet=tilted)
    with pytest.raises(InvalidInput, match="'fiber' is not a unit vector"):
        started(Mechanics, mesh, fiber=1.01 * directions["fiber"], sheet=directions["sheet"])
