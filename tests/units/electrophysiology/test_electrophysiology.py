"""If these fail, the heart's electrical wave starts, spreads, couples to stretch or is timed wrongly."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology.integration import stepper
from cardiac_cosim.units.electrophysiology.ionic.aliev_panfilov import AlievPanfilov
from cardiac_cosim.units.electrophysiology.monodomain import Conduction, Monodomain
from cardiac_cosim.units.electrophysiology.progress import NOT_ACTIVATED
from cardiac_cosim.units.electrophysiology.stimulus import Stimulus
from cardiac_cosim.units.electrophysiology.time_scale import TimeScale
from cardiac_cosim.units.electrophysiology.unit import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.mesh import Mesh
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

_MASSES = ("consistent", "lumped")
_VARIANTS = {
    "quadrature": {"mass_matrix": "consistent", "ionic_current": "quadrature"},
    "nodal": {"mass_matrix": "consistent", "ionic_current": "nodal"},
    "lumped": {"mass_matrix": "lumped"},
}
each_variant = pytest.mark.parametrize("variant", _VARIANTS)

#: Every node of the small meshes at one potential: a cell without neighbours.
_EVERYWHERE = {
    "stimulus_x_min_mm": -1e3,
    "stimulus_x_max_mm": 1e3,
    "stimulus_half_width_mm": 1e3,
    "stimulus_depth_mm": 1e3,
    "time_scale_reduction": 0.0,
}


@pytest.fixture(scope="module")
def cube(box) -> Mesh:
    return box([0.0, 1.0, 2.5], [0.0, 2.0], [-3.0, -1.0, 0.0])


@pytest.fixture(scope="module")
def strand(box) -> Mesh:
    return box(np.linspace(0.0, 24.0, 13), [0.0, 2.0], [-2.0, 0.0])


def _monodomain(mesh: Mesh, along, direction=(1.0, 0.0, 0.0), scale: float = 12.9, **conduction) -> Monodomain:
    return Monodomain(mesh, along(mesh, direction), lambda z: np.full_like(z, scale), Conduction(**conduction))


def _diffuse(monodomain: Monodomain, stretch: np.ndarray, step: float) -> Callable[[np.ndarray], np.ndarray]:
    """The step of the linear part alone: no ionic current, and r, which nothing moves, is checked and left out."""
    advance = stepper(monodomain, stretch, step, lambda phi, recovery: (np.zeros_like(phi), np.zeros_like(recovery)))
    still = np.linspace(0.0, 1.0, monodomain.mass.shape[0])

    def diffuse(phi: np.ndarray) -> np.ndarray:
        (after, recovery), _ = advance(np.stack([phi, still]), np.zeros((2, len(phi))))
        np.testing.assert_array_equal(recovery, still)
        return after

    return diffuse


def _gauss_mass(mesh: Mesh, density: np.ndarray) -> np.ndarray:
    """∫ density N_a N_b with the four-point rule of degree 2; `density` at the nodes of each element, (elements, 4)."""
    shape = np.full((4, 4), 0.1381966011250105) + 0.4472135954999579 * np.eye(4)
    matrix = np.zeros((mesh.nodes, mesh.nodes))
    for cell, volume, nodal in zip(mesh.cells, mesh.volumes, density, strict=True):
        for weights in shape:
            matrix[np.ix_(cell, cell)] += 0.25 * volume * (weights @ nodal) * np.outer(weights, weights)
    return matrix


# --- start ---------------------------------------------------------------------------------------------------------


def test_start_is_rest_but_for_the_stimulus_box(heart, started, along) -> None:
    unit = started(Electrophysiology, heart, fiber=along(heart, (1, 0, 0)))
    x, y, z = heart.points.T
    inside = (x > 0.0) & (x < 31.0) & (np.abs(y) < 10.0) & (z > -2.0)
    assert 0 < inside.sum() < 0.1 * heart.nodes
    np.testing.assert_allclose(unit.get("potential"), np.where(inside, -10.0, -80.0), rtol=1e-14)
    np.testing.assert_array_equal(unit.get("activation_time"), np.where(inside, 0.0, NOT_ACTIVATED))


def test_stimulus_limits_are_excluded_and_depth_zero_is_the_base() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [31, 0, 0], [1, 10, 0], [1, -9.9, 0], [1, 0, -2], [1, 0, -1.9]], float)
    assert Stimulus().nodes(points).tolist() == [False, True, False, False, True, False, True]
    assert Stimulus(stimulus_depth_mm=0.0).nodes(points).tolist() == [False, True, False, False, True, False, False]


def test_stimulus_without_nodes_is_refused(cube, started, along) -> None:
    with pytest.raises(InvalidInput, match=r"no node .* 50 < X < 60.*stimulus_depth_mm"):
        started(
            Electrophysiology,
            cube,
            {"stimulus_x_min_mm": 50.0, "stimulus_x_max_mm": 60.0},
            fiber=along(cube, (1, 0, 0)),
        )


def test_fibres_that_are_no_unit_vectors_are_refused(cube, started, along) -> None:
    with pytest.raises(InvalidInput, match="'fiber' is not a unit vector in element 0"):
        started(Electrophysiology, cube, fiber=np.zeros((cube.elements, 3)))
    fiber = along(cube, (1, 0, 0))
    fiber[3] *= 1.0 + 1e-5
    with pytest.raises(InvalidInput, match="not a unit vector in element 3"):
        started(Electrophysiology, cube, fiber=fiber)
    fiber[3] /= 1.0 + 9e-6
    started(Electrophysiology, cube, fiber=np.clip(fiber, 0.0, 1.0 + 5e-7))


def test_substep_too_long_for_the_upstroke_is_refused(cube, started, along) -> None:
    fiber = along(cube, (1, 0, 0))
    longest = AlievPanfilov().longest_step * 12.9
    parameters = {"time_scale_reduction": 0.0}
    started(Electrophysiology, cube, parameters | {"longest_substep_ms": 0.999 * longest}, fiber=fiber)
    with pytest.raises(InvalidInput, match="longest_substep_ms"):
        started(Electrophysiology, cube, parameters | {"longest_substep_ms": 1.001 * longest}, fiber=fiber)


# --- time scale ----------------------------------------------------------------------------------------------------


def test_time_scale_by_hand() -> None:
    # t_a = 0, 25, 50 ms at the base, half-way and at the apex.
    heights = np.array([0.0, -35.0, -70.0])
    expected = 12.9 * (1.0 - 0.55 * (np.array([0.0, 25.0, 50.0]) - 12.0) / 63.0)
    np.testing.assert_allclose(TimeScale()(heights), expected, rtol=1e-14)
    np.testing.assert_allclose(TimeScale(activation_time_map="as_printed")(heights), expected[::-1], rtol=1e-14)


def test_time_scale_that_is_not_positive_is_refused() -> None:
    heights = np.array([0.0, -70.0])
    # 1 − τ₀ 38/63 at the apex: positive up to τ₀ = 63/38.
    assert TimeScale(time_scale_reduction=0.999 * 63.0 / 38.0)(heights).min() > 0.0
    with pytest.raises(InvalidInput, match=r"Z = -70\.0 mm.*time_scale_reduction"):
        TimeScale(time_scale_reduction=1.001 * 63.0 / 38.0)(heights)
    with pytest.raises(InvalidInput, match="have to differ"):
        TimeScale(time_scale_end_ms=12.0)(heights)


def test_last_to_depolarise_is_first_to_repolarise(box, started, along) -> None:
    # Everything fires at once; the printed map turns the order of repolarisation round.
    column = box([0.0, 35.0], [0.0, 35.0], [-70.0, -35.0, 0.0])
    top, bottom = column.points[:, 2] == 0.0, column.points[:, 2] == -70.0
    ends = {}
    for kind in ("last_first", "as_printed"):
        parameters = _EVERYWHERE | {"activation_time_map": kind, "longest_substep_ms": 1.0}
        del parameters["time_scale_reduction"]
        unit = started(Electrophysiology, column, parameters, fiber=along(column, (1, 0, 0)))
        unit.do_step(0.0, 0.33)
        ends[kind] = unit.get("potential")[top].mean() - unit.get("potential")[bottom].mean()
    assert ends["last_first"] > 20.0
    assert ends["as_printed"] < -20.0


# --- diffusion -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", _MASSES)
def test_uniform_potential_stays_and_charge_is_conserved(mass: str, cube, along) -> None:
    diffuse = _diffuse(_monodomain(cube, along, mass_matrix=mass), np.ones(cube.elements), 0.7)
    np.testing.assert_allclose(diffuse(np.full(cube.nodes, 0.3)), 0.3, rtol=1e-12)
    weights = np.bincount(cube.cells.ravel(), np.repeat(cube.volumes / 4.0, 4))
    before = np.random.default_rng(1).uniform(size=cube.nodes)
    after = diffuse(before)
    assert np.abs(after - before).max() > 0.1
    assert weights @ after == pytest.approx(weights @ before, rel=1e-9)


@pytest.mark.parametrize("mass", _MASSES)
@pytest.mark.parametrize(("axis", "diffusion"), [(0, 1.1), (1, 1.0)])
def test_cosine_decays_at_the_rate_of_its_diffusion(mass: str, axis: int, diffusion: float, box, along, slopes) -> None:
    # cos(πx/L) is an eigenfunction with zero flux: rate d(π/L)², d = 1.1 along the fibre and 1.0 across it.
    length, exact = 8.0, diffusion * (np.pi / 8.0) ** 2
    cells, errors = [4, 8, 16], []
    for count in cells:
        mesh = box(np.linspace(0.0, length, count + 1), [0.0, length / count], [-length / count, 0.0])
        step = _diffuse(_monodomain(mesh, along, np.eye(3)[axis], mass_matrix=mass), np.ones(mesh.elements), 0.02)
        start = np.cos(np.pi * mesh.points[:, 0] / length)
        phi = start
        for _ in range(50):
            phi = step(phi)
        weights = np.bincount(mesh.cells.ravel(), np.repeat(mesh.volumes, 4)) * start
        errors.append(abs(-np.log((weights @ phi) / (weights @ start)) - exact))
    orders = slopes([length / count for count in cells], errors)
    assert ((orders > 1.8) & (orders < 2.3)).all(), orders


@pytest.mark.parametrize("mass", _MASSES)
def test_linear_step_is_of_second_order(mass: str, cube, along, slopes) -> None:
    stretch = 1.0 + 0.1 * np.random.default_rng(2).uniform(size=cube.elements)
    monodomain = _monodomain(cube, along, mass_matrix=mass)
    start = np.sin(cube.points.sum(axis=1))

    def end(steps: int) -> np.ndarray:
        step, phi = _diffuse(monodomain, stretch, 0.4 / steps), start
        for _ in range(steps):
            phi = step(phi)
        return phi

    counts, exact = [4, 8, 16], end(512)
    orders = slopes([1.0 / count for count in counts], [np.abs(end(count) - exact).max() for count in counts])
    assert ((orders > 1.8) & (orders < 2.2)).all(), orders


@pytest.mark.parametrize("mass", _MASSES)
def test_linear_step_is_l_stable(mass: str, cube, along) -> None:
    # A step without end leaves only the mean: nothing rings, as it would with the trapezoidal rule.
    after = _diffuse(_monodomain(cube, along, mass_matrix=mass), np.ones(cube.elements), 1e7)(np.sin(cube.points[:, 0]))
    assert np.ptp(after) < 1e-5


# --- load of the ionic current -------------------------------------------------------------------------------------


@each_variant
def test_load_of_a_linear_current_is_exact(variant: str, heart, along) -> None:
    # ∫ p N_a with p linear: the degree 2 of the rule, and with the consistent mass p is its own interpolant. By hand,
    # per element: V/20 (p_a + Σ p_b), lumped V/4 p_a. A constant current gives V/4 in all three.
    monodomain = _monodomain(heart, along, **_VARIANTS[variant])
    linear = 0.3 + heart.points @ [0.02, -0.01, 0.005]
    for current in (np.full(heart.nodes, 1.7), linear):
        values = current[heart.cells]
        if variant == "lumped":
            parts = heart.volumes[:, None] / 4.0 * values
        else:
            parts = heart.volumes[:, None] / 20.0 * (values + values.sum(axis=1, keepdims=True))
        by_hand = np.bincount(heart.cells.ravel(), parts.ravel())
        np.testing.assert_allclose(
            monodomain.load @ (monodomain.to_points @ current), by_hand, rtol=0.0, atol=1e-12 * np.abs(by_hand).max()
        )


def test_loads_of_constant_fields_agree(heart, along) -> None:
    phi, recovery = np.full(heart.nodes, 0.4), np.full(heart.nodes, 0.7)
    loads = []
    for parameters in _VARIANTS.values():
        monodomain = _monodomain(heart, along, **parameters)
        current, _ = AlievPanfilov().rates(monodomain.to_points @ phi, monodomain.to_points @ recovery)
        loads.append(monodomain.load @ (monodomain.point_rate * current))
    assert np.abs(loads[0]).min() > 0.0
    for load in loads[1:]:
        np.testing.assert_allclose(load, loads[0], rtol=1e-12)


def test_charge_of_a_quadratic_current_is_exact_by_quadrature_only(box, along) -> None:
    # Σ_a ∫ φ² N_a = ∫ φ² is of degree 2, though its parts are of degree 3. φ = z over 1 × 2 × 3 mm: 2·27/3.
    mesh = box([0.0, 1.0], [0.0, 1.0, 2.0], [-3.0, -2.2, 0.0])
    charges = {}
    for variant, parameters in _VARIANTS.items():
        monodomain = _monodomain(mesh, along, **parameters)
        charges[variant] = (monodomain.load @ (monodomain.to_points @ mesh.points[:, 2]) ** 2).sum()
    assert charges["quadrature"] == pytest.approx(18.0, rel=1e-13)
    # At the nodes: the trapezoidal rule on the two layers, 2 (0.8³ + 2.2³)/6 too much.
    for variant in ("nodal", "lumped"):
        assert charges[variant] == pytest.approx(18.0 + (0.8**3 + 2.2**3) / 3.0, rel=1e-12)


@each_variant
def test_load_of_the_ionic_current_converges_at_second_order(variant: str, box, along, slopes) -> None:
    def phi_of(x: np.ndarray) -> np.ndarray:
        return 0.9 * np.cos(np.pi * x / 16.0)

    def recovery_of(x: np.ndarray) -> np.ndarray:
        return 0.2 + 0.1 * x

    def weight(x: np.ndarray) -> np.ndarray:
        return np.exp(-x / 4.0)

    points, weights = np.polynomial.legendre.leggauss(40)
    fine = 4.0 * (points + 1.0)
    current, _ = AlievPanfilov().rates(phi_of(fine), recovery_of(fine))
    exact = 4.0 * weights @ (current * weight(fine)) / 9.0
    counts, errors = [4, 8, 16], []
    for count in counts:
        mesh = box(np.linspace(0.0, 8.0, count + 1), [0.0, 1.0], [-1.0, 0.0])
        monodomain = _monodomain(mesh, along, scale=9.0, **_VARIANTS[variant])
        x = mesh.points[:, 0]
        current, _ = AlievPanfilov().rates(monodomain.to_points @ phi_of(x), monodomain.to_points @ recovery_of(x))
        errors.append(abs(weight(x) @ (monodomain.load @ (monodomain.point_rate * current)) - exact))
    orders = slopes([8.0 / count for count in counts], errors)
    assert ((orders > 1.8) & (orders < 2.2)).all(), (orders, errors)


def test_time_scale_is_taken_where_the_current_is(heart, along) -> None:
    for variant, parameters in _VARIANTS.items():
        monodomain = Monodomain(heart, along(heart, (1, 0, 0)), TimeScale(), Conduction(**parameters))
        np.testing.assert_allclose(monodomain.node_rate * TimeScale()(heart.points[:, 2]), 1.0, rtol=1e-14)
        heights = monodomain.to_points @ heart.points[:, 2]
        assert len(heights) == (4 * heart.elements if variant == "quadrature" else heart.nodes)
        np.testing.assert_allclose(monodomain.point_rate * TimeScale()(heights), 1.0, rtol=1e-14)


def test_lumped_mass_has_no_quadrature(strand, started, along) -> None:
    ends = []
    for current in ("nodal", "quadrature"):
        unit = started(
            Electrophysiology,
            strand,
            {"mass_matrix": "lumped", "ionic_current": current, "stimulus_x_max_mm": 7.0},
            fiber=along(strand, (1, 0, 0)),
        )
        unit.do_step(0.0, 0.004)
        ends.append({name: value.tobytes() for name, value in unit.get_state().state.items()})
    assert ends[0] == ends[1]


# --- stretch-activated current -------------------------------------------------------------------------------------


def test_conductance_is_the_quadrature_by_hand(cube, along) -> None:
    stretch = 1.0 + np.random.default_rng(3).uniform(-0.1, 0.1, cube.elements)
    assert (stretch < 1.0).any()
    rate = 7.0 * np.clip(stretch - 1.0, 0.0, None) / 9.0
    by_hand = _gauss_mass(cube, np.tile(rate[:, None], 4))
    parts = {"scale": 9.0, "stretch_conductance": 7.0}
    consistent = _monodomain(cube, along, **parts).conductance(stretch).toarray()
    lumped = _monodomain(cube, along, mass_matrix="lumped", **parts).conductance(stretch).toarray()
    np.testing.assert_allclose(consistent, by_hand, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(lumped, np.diag(by_hand.sum(axis=1)), rtol=1e-12, atol=1e-15)


def test_conductance_with_varying_time_scale_converges_at_second_order(box, along, slopes) -> None:
    # The rate 1/β_t enters by its element mean; against ∫ (G_s(λ−1)/β_t) p² with p and 1/β_t as given.
    cells, errors = [2, 4, 8], []
    for count in cells:
        axis = np.linspace(0.0, 4.0, count + 1)
        mesh = box(axis, axis, axis - 4.0)
        height = mesh.points[:, 2] + 4.0
        monodomain = Monodomain(mesh, along(mesh, (1, 0, 0)), lambda z: 1.0 / (0.3 + 0.05 * z), Conduction())
        # ∫ 10·0.1·(0.1 + 0.05h) h² over 4 × 4 × 4 with h itself in the trial space: exact but for the element mean.
        value = height @ (monodomain.conductance(np.full(mesh.elements, 1.1)) @ height)
        errors.append(abs(value - 16.0 * (0.1 * 64.0 / 3.0 + 0.05 * 64.0)))
    orders = slopes([4.0 / count for count in cells], errors)
    assert ((orders > 1.8) & (orders < 2.2)).all(), orders


@pytest.mark.parametrize("mass", _MASSES)
def test_no_conductance_where_the_fibre_is_not_stretched(mass: str, cube, along) -> None:
    monodomain = _monodomain(cube, along, mass_matrix=mass)
    for stretch in (0.5, 1.0):
        assert not monodomain.conductance(np.full(cube.elements, stretch)).toarray().any()
    one = np.full(cube.elements, 0.9)
    one[4] = np.nextafter(1.0, 2.0)
    touched = np.flatnonzero(monodomain.conductance(one).toarray().any(axis=1))
    assert touched.tolist() == sorted(cube.cells[4].tolist())


@pytest.mark.parametrize("mass", _MASSES)
def test_reversal_potential_is_a_rest_state_of_the_linear_part(mass: str, cube, along) -> None:
    stretch = 1.0 + np.random.default_rng(4).uniform(-0.1, 0.2, cube.elements)
    step = _diffuse(_monodomain(cube, along, mass_matrix=mass, stretch_reversal=0.6), stretch, 0.5)
    np.testing.assert_allclose(step(np.full(cube.nodes, 0.6)), 0.6, rtol=1e-12)
    # From either side the potential is driven towards it.
    assert (step(np.zeros(cube.nodes)) > 1e-3).all()
    assert (step(np.ones(cube.nodes)) < 1.0 - 1e-3).all()


def test_uniform_stretch_relaxes_to_reversal_at_its_rate(cube, along) -> None:
    # M dφ/dt = −G(φ − φ_s) with uniform λ: dφ/dt = −(G_s(λ−1)/β_t)(φ − φ_s) at every node.
    step = _diffuse(_monodomain(cube, along), np.full(cube.elements, 1.05), 0.05)
    phi = np.zeros(cube.nodes)
    for _ in range(100):
        phi = step(phi)
    np.testing.assert_allclose(phi, 0.6 * (1.0 - np.exp(-0.5 / 12.9 * 5.0)), rtol=1e-6)


def _firing_stretch() -> float:
    """λ − 1 above which φ' = −cφ(φ−α)(φ−1) + G_s(λ−1)(φ_s−φ) has no rest near 0 any more."""
    balance = minimize_scalar(
        lambda phi: 8.0 * phi * (phi - 0.01) * (phi - 1.0) / (0.6 - phi) / -10.0, bounds=(0.0, 0.01), method="bounded"
    )
    return -float(balance.fun)


@each_variant
def test_resting_tissue_fires_by_itself_just_above_the_balance_and_not_below(variant: str, box, started, along) -> None:
    # Independent computation (docs/model.md, Numbers to verify against): λ − 1 > 3.3e-5 with r = 0.
    firing = _firing_stretch()
    assert firing == pytest.approx(3.3e-5, abs=0.1e-5)
    grain = box([0.0, 1.0], [0.0, 1.0], [-1.0, 0.0])
    parameters = _EVERYWHERE | _VARIANTS[variant]
    parameters |= {
        "stimulus_potential_mV": -80.0,
        "longest_substep_ms": 1.6,
        "recovery_rate": 0.0,
        "recovery_mu1": 0.0,
    }
    ends = {}
    for factor in (0.97, 1.03):
        unit = started(
            Electrophysiology,
            grain,
            parameters,
            fiber=along(grain, (1, 0, 0)),
            stretch=np.full(grain.elements, 1.0 + factor * firing),
        )
        unit.do_step(0.0, 12.0)
        ends[factor] = unit.get("potential"), unit.get("activation_time")
    # Below, at the rest that the balance gives; above, at the plateau.
    rest = brentq(lambda phi: 8.0 * phi * (phi - 0.01) * (phi - 1.0) - 9.7 * firing * (0.6 - phi), 0.0, 0.005)
    np.testing.assert_allclose(ends[0.97][0], 100.0 * rest - 80.0, atol=2e-2)
    assert (ends[0.97][1] == NOT_ACTIVATED).all()
    assert (ends[1.03][0] > 19.0).all()
    assert (ends[1.03][1] > 1000.0).all()


def test_stretch_acts_only_through_its_conductance(cube, started, along) -> None:
    stretched = np.full(cube.elements, 1.1)
    fiber = along(cube, (1, 0, 0))
    parameters = _EVERYWHERE | {"stimulus_potential_mV": -80.0}
    ends = []
    for conductance in (10.0, 0.0):
        unit = started(
            Electrophysiology, cube, parameters | {"stretch_conductance": conductance}, fiber=fiber, stretch=stretched
        )
        unit.do_step(0.0, 0.01)
        ends.append(unit.get("potential"))
    assert (ends[0] > -79.0).all()
    np.testing.assert_array_equal(ends[1], -80.0)


# --- accuracy in time ----------------------------------------------------------------------------------------------


@each_variant
def test_unit_converges_at_second_order_to_the_equations_between_the_nodes(
    variant: str, strand, started, along, monodomain_equations, slopes
) -> None:
    fiber = along(strand, (1, 0, 0))
    stretch = 1.0 + 0.01 * np.random.default_rng(5).uniform(-1.0, 1.0, strand.elements)
    parameters = {
        "stimulus_x_min_mm": -1.0,
        "stimulus_x_max_mm": 7.0,
        "stimulus_depth_mm": 9.0,
        "stimulus_potential_mV": 10.0,
        # Steep in Z, so that the time scale differs between the nodes and the points of the quadrature.
        "apex_z_mm": -4.0,
    }
    time_scale = TimeScale(apex_z_mm=-4.0)
    assert np.ptp(time_scale(strand.points[:, 2])) > 2.0
    start = np.concatenate([np.where(strand.points[:, 0] < 7.0, 0.9, 0.0), np.zeros(strand.nodes)])
    equations = monodomain_equations(strand, fiber, stretch, time_scale, variant)
    exact = solve_ivp(equations, (0.0, 12.0), start, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    # A wave is under way: the order is not measured on a state of rest.
    assert np.ptp(exact[: strand.nodes]) > 0.9
    substeps, errors = [0.5, 0.25, 0.125, 0.0625], []
    for substep in substeps:
        unit = started(
            Electrophysiology,
            strand,
            parameters | _VARIANTS[variant] | {"longest_substep_ms": substep},
            fiber=fiber,
            stretch=stretch,
        )
        unit.do_step(0.0, 0.012)
        state = unit.get_state().state
        errors.append(np.abs(np.concatenate([state["phi"], state["recovery"]]) - exact).max())
    orders = slopes(substeps, errors)
    assert ((orders > 1.85) & (orders < 2.25)).all(), (orders, errors)


@each_variant
def test_step_of_zero_leaves_the_beating_heart_as_it_is(variant: str, heart, started, along) -> None:
    # A linear system is solved here as well: what it returns is what it was given, to the bit.
    stretch = 1.0 + 0.1 * np.random.default_rng(6).uniform(-1.0, 1.0, heart.elements)
    unit = started(Electrophysiology, heart, _VARIANTS[variant], fiber=along(heart, (1, 0, 0)), stretch=stretch)
    for time in (0.0, 0.004):
        before = unit.get_state().state
        unit.do_step(time, 0.0)
        for name, value in unit.get_state().state.items():
            assert value.tobytes() == before[name].tobytes(), (time, name)
        unit.do_step(time, 0.004)
    assert np.ptp(before["phi"]) > 0.5


@each_variant
def test_repeated_step_gives_the_same_bits(variant: str, cube, started, along) -> None:
    stretch = 1.0 + 0.1 * np.random.default_rng(7).uniform(-1.0, 1.0, cube.elements)
    units = [
        started(
            Electrophysiology,
            cube,
            _VARIANTS[variant] | {"stimulus_x_min_mm": 0.5},
            fiber=along(cube, (1, 0, 0)),
            stretch=stretch,
        )
        for _ in range(2)
    ]
    saved, ends = units[0].get_state(), []
    for unit in (units[0], units[0], units[1]):
        unit.set_state(saved)
        unit.do_step(0.0, 0.003)
        ends.append([value.tobytes() for value in unit.get_state().state.values()])
    assert ends[0] == ends[1] == ends[2]


def test_communication_steps_of_whole_substeps_do_not_matter(strand, started, along) -> None:
    fiber, parameters = along(strand, (1, 0, 0)), {"stimulus_x_max_mm": 7.0}
    units = [started(Electrophysiology, strand, parameters, fiber=fiber) for _ in range(2)]
    units[0].do_step(0.0, 0.004)
    for number in range(8):
        units[1].do_step(0.0005 * number, 0.0005)
    assert np.ptp(units[0].get("potential")) > 40.0
    np.testing.assert_allclose(units[1].get("potential"), units[0].get("potential"), rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(units[1].get("activation_time"), units[0].get("activation_time"), rtol=0.0, atol=1e-8)


# --- activation time -----------------------------------------------------------------------------------------------


def test_activation_is_the_crossing_linear_within_a_substep(cube, started, along) -> None:
    parameters = _EVERYWHERE | {"stimulus_potential_mV": -60.0, "longest_substep_ms": 1.0}
    unit = started(Electrophysiology, cube, parameters, fiber=along(cube, (1, 0, 0)))
    course = [unit.get("potential")]
    for number in range(60):
        unit.do_step(1e-3 * number, 1e-3)
        course.append(unit.get("potential"))
        if course[-1].max() < -20.0:
            assert (unit.get("activation_time") == NOT_ACTIVATED).all()
    levels = np.array(course)
    after = np.argmax(levels >= -20.0, axis=0)
    assert (after > 1).all()
    nodes = np.arange(cube.nodes)
    low, high = levels[after - 1, nodes], levels[after, nodes]
    np.testing.assert_allclose(unit.get("activation_time"), after - 1 + (-20.0 - low) / (high - low), rtol=1e-9)


def test_activation_time_converges_to_the_crossing_of_the_equations(cube, started, along, slopes) -> None:
    def crossing(_: float, values: np.ndarray) -> float:
        return values[0] - 0.6

    crossing.terminal = True
    exact = solve_ivp(
        lambda _, v: np.stack([part[0] for part in AlievPanfilov().rates(v[:1], v[1:])]),
        (0.0, 50.0),
        [0.2, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
        events=crossing,
    ).t_events[0][0]
    errors, steps = [], [1.6, 0.8, 0.4, 0.2]
    for step in steps:
        # β_t so that the crossing falls in the middle of a substep of any length: only so is the order a clean one.
        time = step * (round(12.9 * exact / step) + 0.5)
        parameters = _EVERYWHERE | {"stimulus_potential_mV": -60.0, "longest_substep_ms": step}
        parameters["time_scale_ms"] = time / exact
        unit = started(Electrophysiology, cube, parameters, fiber=along(cube, (1, 0, 0)))
        unit.do_step(0.0, 1e-3 * step * round(1.2 * time / step))
        times = unit.get("activation_time")
        assert (times > 0.0).all()
        errors.append(np.abs(times - time).max())
    orders = slopes(steps, errors)
    assert (orders > 1.8).all(), (orders, errors)


def test_activation_time_keeps_the_first_crossing(cube, started, along) -> None:
    parameters = _EVERYWHERE | {"stimulus_potential_mV": -60.0}
    unit = started(Electrophysiology, cube, parameters, fiber=along(cube, (1, 0, 0)))
    unit.do_step(0.0, 0.05)
    first = unit.get("activation_time")
    assert (first > 0.0).all()
    # The same tissue again below threshold and without recovery, later in time: it crosses a second time.
    saved = unit.get_state()
    again = dict(saved.state) | {"phi": np.full(cube.nodes, 0.2), "recovery": np.zeros(cube.nodes)}
    unit.set_state(replace(saved, state=again))
    assert unit.get("potential").max() < -20.0
    unit.do_step(0.05, 0.05)
    assert unit.get("potential").min() > -20.0
    np.testing.assert_array_equal(unit.get("activation_time"), first)


def test_downward_crossing_is_no_activation(cube, started, along) -> None:
    unit = started(
        Electrophysiology,
        cube,
        _EVERYWHERE | {"stimulus_potential_mV": -21.0, "activation_potential_mV": -20.0},
        fiber=along(cube, (1, 0, 0)),
    )
    saved = unit.get_state()
    falling = dict(saved.state) | {"phi": np.full(cube.nodes, 0.65), "recovery": np.full(cube.nodes, 3.0)}
    unit.set_state(replace(saved, state=falling))
    unit.do_step(0.0, 0.05)
    assert unit.get("potential").max() < -20.0
    assert (unit.get("activation_time") == NOT_ACTIVATED).all()


# --- failure -------------------------------------------------------------------------------------------------------


def test_potential_that_leaves_the_numbers_ends_the_step(cube, started, along) -> None:
    unit = started(Electrophysiology, cube, fiber=along(cube, (1, 0, 0)))
    unit.do_step(0.0, 0.001)
    before = unit.get_state()
    unit.set("stretch", np.full(cube.elements, 1.7e308))
    with np.errstate(all="ignore"), pytest.raises(StepFailure, match=r"not finite|did not converge"):
        unit.do_step(0.001, 0.001)
    for name, value in before.state.items():
        np.testing.assert_array_equal(unit.get_state().state[name], value)
