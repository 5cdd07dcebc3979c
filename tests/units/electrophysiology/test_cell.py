"""If these fail, a heart cell fires at the wrong potential or keeps its action potential for the wrong time."""

from dataclasses import replace

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.electrophysiology.integration import stepper
from cardiac_cosim.units.electrophysiology.ionic.aliev_panfilov import AlievPanfilov
from cardiac_cosim.units.electrophysiology.monodomain import Conduction, Monodomain
from cardiac_cosim.units.mesh import Mesh
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

_CELL = AlievPanfilov()
_NO_RECOVERY = AlievPanfilov(recovery_rate=0.0, recovery_mu1=0.0)
_SCALE_MS = 12.9

_VARIANTS = {
    "quadrature": {"mass_matrix": "consistent", "ionic_current": "quadrature"},
    "nodal": {"mass_matrix": "consistent", "ionic_current": "nodal"},
    "lumped": {"mass_matrix": "lumped"},
}
each_variant = pytest.mark.parametrize("variant", _VARIANTS)


def _equations(_: float, values: np.ndarray) -> list[float]:
    """The ionic model of docs/model.md, written a second time, with its numbers."""
    phi, r = values
    return [
        -8.0 * phi * (phi - 0.01) * (phi - 1.0) - r * phi,
        (0.002 + 0.2 * r / (0.3 + phi)) * (-r - 8.0 * phi * (phi - 0.15 - 1.0)),
    ]


def _course(cell: AlievPanfilov, start: float, times: np.ndarray) -> np.ndarray:
    """φ and r at the dimensionless `times`, shape (2, times), by tight integration of the model's rates."""

    def rates(_: float, values: np.ndarray) -> np.ndarray:
        return np.concatenate(cell.rates(values[:1], values[1:]))

    solution = solve_ivp(rates, (0.0, times[-1]), [start, 0.0], method="DOP853", t_eval=times, rtol=1e-12, atol=1e-14)
    return solution.y


def _duration_90(times: np.ndarray, phi: np.ndarray) -> float:
    """Time at which the potential has fallen by 90 % of its amplitude."""
    fallen = CubicSpline(times, phi - 0.1 * phi.max()).roots(extrapolate=False)
    assert len(fallen) == 1
    return float(fallen[0])


@pytest.fixture(scope="module")
def grain(box) -> Mesh:
    return box([0.0, 1.0], [0.0, 1.0], [-1.0, 0.0])


@pytest.fixture(scope="module")
def tissue(grain, started, along):
    """The unit with one potential everywhere: no current flows between the nodes, and the tissue is one cell."""

    def make(variant: str, start: float = 0.7, substep: float = 0.25, **parameters) -> Electrophysiology:
        everywhere = {
            "stimulus_x_min_mm": -1e3,
            "stimulus_x_max_mm": 1e3,
            "stimulus_half_width_mm": 1e3,
            "stimulus_depth_mm": 1e3,
            "stimulus_potential_mV": 100.0 * start - 80.0,
            "time_scale_reduction": 0.0,
            "longest_substep_ms": substep,
        }
        unit = started(
            Electrophysiology,
            grain,
            everywhere | _VARIANTS[variant] | parameters,
            fiber=along(grain, (1.0, 0.0, 0.0)),
        )
        assert (unit.get("potential") == unit.get("potential")[0]).all()
        return unit

    return make


def _tissue_course(unit: Electrophysiology, every_ms: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    """Dimensionless times up to `until` and the course of φ and r, shape (2, times)."""
    count = round(until * _SCALE_MS / every_ms)
    course = []
    for number in range(count + 1):
        state = unit.get_state().state
        for name in ("phi", "recovery"):
            # Linear systems are solved to a residual of 1e-9.
            assert np.ptp(state[name]) < 1e-7, name
        course.append((state["phi"].mean(), state["recovery"].mean()))
        unit.do_step(1e-3 * every_ms * number, 1e-3 * every_ms)
    return np.arange(count + 1) * every_ms / _SCALE_MS, np.array(course).T


# --- the equations -------------------------------------------------------------------------------------------------


def test_rates_at_a_point_by_hand() -> None:
    phi_rate, recovery_rate = _CELL.rates(np.array([0.5]), np.array([1.2]))
    # −(8·0.5·0.49·(−0.5) + 1.2·0.5) and (0.002 + 0.2·1.2/0.8)(−1.2 − 8·0.5·(−0.65)).
    assert phi_rate[0] == pytest.approx(0.38, rel=1e-14)
    assert recovery_rate[0] == pytest.approx(0.302 * 1.4, rel=1e-14)


def test_rates_are_the_printed_equations_at_any_point() -> None:
    phi, recovery = np.random.default_rng(11).uniform([[-0.2], [0.0]], [[1.2], [3.0]], (2, 200))
    by_hand = np.array([_equations(0.0, values) for values in np.stack([phi, recovery], axis=1)]).T
    np.testing.assert_allclose(_CELL.rates(phi, recovery), by_hand, rtol=1e-12, atol=1e-14)


def test_action_potential_is_the_independent_computations() -> None:
    # Independent computation from φ = 0.7, r = 0 (docs/model.md, Numbers to verify against).
    times = np.linspace(0.0, 60.0, 3001)
    phi, recovery = _course(_CELL, 0.7, times)
    assert _duration_90(times, phi) == pytest.approx(31.26, abs=0.01)
    assert 100.0 * phi.max() - 80.0 == pytest.approx(19.95, abs=0.005)
    assert recovery.max() == pytest.approx(2.336, abs=0.0005)


def test_action_potential_returns_to_rest() -> None:
    phi, recovery = _course(_CELL, 0.7, np.array([0.0, 400.0]))[:, -1]
    assert -1e-12 < phi < 1e-6
    assert 0.0 <= recovery < 0.02


def test_rest_is_a_fixed_point_to_the_bit() -> None:
    for rate in _CELL.rates(np.zeros(3), np.zeros(3)):
        assert (rate == 0.0).all()


def test_small_disturbance_of_rest_decays_at_the_linear_rate() -> None:
    # Linear about rest with r = 0: φ' = −cαφ.
    phi, _ = _course(_NO_RECOVERY, 1e-7, np.array([0.0, 20.0]))
    assert phi[-1] == pytest.approx(1e-7 * np.exp(-8.0 * 0.01 * 20.0), rel=1e-4)


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.3])
def test_threshold_of_excitation_from_both_sides(alpha: float) -> None:
    cell = AlievPanfilov(excitation_threshold=alpha, recovery_rate=0.0, recovery_mu1=0.0)
    times = np.array([0.0, 1000.0])
    below, _ = _course(cell, alpha * (1.0 - 1e-6), times)
    above, _ = _course(cell, alpha * (1.0 + 1e-6), times)
    assert abs(below[-1]) < 1e-6
    assert above[-1] == pytest.approx(1.0, abs=1e-9)


# --- the same cell as a homogeneous tissue in the unit ---------------------------------------------------------------


@each_variant
def test_homogeneous_tissue_has_the_action_potential_of_the_cell(variant: str, tissue) -> None:
    # Independent computation (docs/model.md, Numbers to verify against); at the unit's default substep.
    times, (phi, recovery) = _tissue_course(tissue(variant), 1.0, 45.0)
    assert _duration_90(times, phi) == pytest.approx(31.26, abs=0.01)
    assert 100.0 * phi.max() - 80.0 == pytest.approx(19.95, abs=0.005)
    assert recovery.max() == pytest.approx(2.336, abs=0.0005)


@each_variant
def test_homogeneous_tissue_returns_to_rest(variant: str, tissue) -> None:
    unit = tissue(variant, substep=1.6)
    unit.do_step(0.0, 400.0e-3 * _SCALE_MS)
    state = unit.get_state().state
    assert state["phi"].min() > -1e-12
    assert state["phi"].max() < 1e-6
    assert state["recovery"].min() >= 0.0
    assert state["recovery"].max() < 0.02


@each_variant
def test_homogeneous_tissue_is_of_second_order_in_its_substep(variant: str, tissue, slopes) -> None:
    exact = solve_ivp(_equations, (0.0, 20.0), [0.7, 0.0], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    substeps, errors = [0.04 * _SCALE_MS, 0.02 * _SCALE_MS, 0.01 * _SCALE_MS], []
    for substep in substeps:
        unit = tissue(variant, substep=substep)
        unit.do_step(0.0, 20.0e-3 * _SCALE_MS)
        state = unit.get_state().state
        errors.append(max(np.abs(state["phi"] - exact[0]).max(), np.abs(state["recovery"] - exact[1]).max()))
    orders = slopes(substeps, errors)
    assert ((orders > 1.9) & (orders < 2.1)).all(), (orders, errors)


@each_variant
def test_longest_substep_neither_overshoots_nor_changes_the_duration(variant: str, tissue) -> None:
    step = _CELL.longest_step * _SCALE_MS
    times, (phi, _) = _tissue_course(tissue(variant, substep=step), step, 60.0)
    assert phi.max() < 1.0
    assert _duration_90(times, phi) == pytest.approx(31.26, rel=1e-3)


@each_variant
def test_stability_limit_of_the_step_from_both_sides(variant: str, grain, along) -> None:
    # At the plateau φ = 1 (r = 0) the rate is −c(1 − α); an explicit step of second order, 1 + z + z²/2, is stable
    # up to 2 over it.
    limit = 2.0 / (8.0 * 0.99)
    assert 2.0 * _CELL.longest_step < limit
    fiber, still = along(grain, (1.0, 0.0, 0.0)), np.ones(grain.elements)
    monodomain = Monodomain(grain, fiber, np.ones_like, Conduction(**_VARIANTS[variant]))

    def distance(step: float, until: float) -> float:
        advance = stepper(monodomain, still, step, _NO_RECOVERY.rates)
        values = np.stack([np.full(grain.nodes, 1.0 - 1e-6), np.zeros(grain.nodes)])
        for _ in range(round(until / step)):
            values, _ = advance(values, np.zeros((2, grain.nodes)))
        return float(np.abs(values[0] - 1.0).max())

    # The linear systems are solved to a residual of 1e-9.
    assert distance(0.97 * limit, 200.0) < 3e-9
    assert distance(1.03 * limit, 50.0) > 1e-5


@pytest.mark.parametrize("variant", ["nodal", "lumped"])
def test_nodes_without_diffusion_advance_by_themselves_each_with_its_time_scale(
    variant: str, box, started, along
) -> None:
    column = box([0.0, 1.0], [0.0, 1.0], [-70.0, -30.0, 0.0])
    start, recovery = np.random.default_rng(12).uniform([[0.1], [0.0]], [[0.9], [1.0]], (2, column.nodes))
    isolated = {"diffusion_isotropic_mm2_per_ms": 0.0, "diffusion_anisotropic_mm2_per_ms": 0.0}

    def end(**parameters: float) -> np.ndarray:
        unit = started(
            Electrophysiology,
            column,
            isolated | _VARIANTS[variant] | {"stimulus_depth_mm": 1e3, "stimulus_x_min_mm": -1.0} | parameters,
            fiber=along(column, (1.0, 0.0, 0.0)),
        )
        saved = unit.get_state()
        state = dict(saved.state) | {"phi": start, "recovery": recovery}
        unit.set_state(replace(saved, state=state))
        unit.do_step(0.0, 0.02)
        return unit.get("potential")

    # β_t by hand at the base, 30 mm below and at the apex: t_a = 50·(−Z/70).
    together, heights = end(), column.points[:, 2]
    for height in (0.0, -30.0, -70.0):
        scale = 12.9 * (1.0 - 0.55 * (50.0 * height / -70.0 - 12.0) / 63.0)
        alone = end(time_scale_ms=scale, time_scale_reduction=0.0)
        here = heights == height
        assert here.sum() == 4
        np.testing.assert_allclose(together[here], alone[here], rtol=0.0, atol=1e-5)
        assert (np.abs(together[~here] - alone[~here]) > 1e-2).any()


@each_variant
def test_tissue_at_rest_stays_there_to_the_bit(variant: str, tissue) -> None:
    unit = tissue(variant, start=0.0)
    unit.do_step(0.0, 0.1)
    state = unit.get_state().state
    assert (state["phi"] == 0.0).all()
    assert (state["recovery"] == 0.0).all()
    np.testing.assert_array_equal(unit.get("potential"), -80.0)
