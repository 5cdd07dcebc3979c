"""If these fail, hearts of Mitchell-Schaeffer cells beat for the wrong time, or their waves run at the wrong speed."""

from math import exp, log, sqrt
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.electrophysiology.ionic.mitchell_schaeffer import MitchellSchaeffer
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from scipy.integrate import solve_ivp

_CELL = MitchellSchaeffer()
_CHOICE = {"ionic_model": "mitchell_schaeffer", "time_scale_reduction": 0.0, "stretch_conductance": 0.0}
_EVERYWHERE = {
    "stimulus_x_min_mm": -1e3,
    "stimulus_x_max_mm": 1e3,
    "stimulus_half_width_mm": 1e3,
    "stimulus_depth_mm": 1e3,
}


def _duration(cell: MitchellSchaeffer, gate: float = 1.0) -> tuple[float, float]:
    """How long φ stays above φ_gate from 0.7 on, with the gate as given at the begin; and the gate at the end."""

    def fallen(_: float, values: np.ndarray) -> float:
        return values[0] - cell.gate_threshold

    fallen.terminal = True
    fallen.direction = -1.0

    def rates(_: float, values: np.ndarray) -> list[float]:
        return [float(rate[0]) for rate in cell.rates(values[:1], values[1:])]

    solution = solve_ivp(rates, (0.0, 1e4), [0.7, gate], method="LSODA", rtol=1e-9, atol=1e-11, events=fallen)
    return float(solution.t_events[0][0]), float(solution.y_events[0][0][1])


@pytest.fixture(scope="module")
def grain(box) -> Mesh:
    return box([0.0, 1.0], [0.0, 1.0], [-1.0, 0.0])


def test_rates_at_a_point_by_hand() -> None:
    # 0.8·0.25·0.5/0.3 − 0.5/6 and −0.8/150; below the threshold (1 − 0.8)/120.
    rate, closing = _CELL.rates(np.array([0.5, 0.1]), np.array([0.8, 0.8]))
    assert rate[0] == pytest.approx(1.0 / 3.0 - 0.5 / 6.0, rel=1e-14)
    np.testing.assert_allclose(closing, [-0.8 / 150.0, 0.2 / 120.0], rtol=1e-14)


def test_rest_is_a_fixed_point() -> None:
    for rate in _CELL.rates(np.zeros(3), np.ones(3)):
        assert (rate == 0.0).all()


def test_duration_of_the_action_potential_tends_to_its_leading_order(slopes) -> None:
    # τ_close ln(τ_out/(4 τ_in)) for fast currents (Mitchell & Schaeffer 2003, section 3); what is left of a fold falls
    # with the fast time to the power of two thirds.
    leading = 150.0 * log(6.0 / (4.0 * 0.3))
    fast, errors = [1.0, 1.0 / 8.0, 1.0 / 64.0], []
    for factor in fast:
        duration, _ = _duration(MitchellSchaeffer(inward_time_ms=0.3 * factor, outward_time_ms=6.0 * factor))
        errors.append(duration - leading)
    assert 0.0 < errors[0] < 0.2 * leading
    assert errors[-1] < 0.015 * leading
    orders = slopes(fast, errors)
    assert ((orders > 0.55) & (orders < 1.0)).all(), (orders, errors)


def test_restitution_tends_to_its_leading_order() -> None:
    # After a diastolic interval D the gate has opened to 1 − (1 − h_min) exp(−D/τ_open), h_min = 4 τ_in/τ_out = 0.2.
    cell = MitchellSchaeffer(inward_time_ms=0.3 / 64.0, outward_time_ms=6.0 / 64.0)
    for interval in (60.0, 150.0, 400.0):
        gate = 1.0 - 0.8 * exp(-interval / 120.0)
        assert _duration(cell, gate)[0] == pytest.approx(150.0 * log(gate / 0.2), rel=0.03), interval


def test_the_unit_has_the_action_potential_of_the_cell(grain: Mesh, started: Any, along: Any) -> None:
    unit = started(Electrophysiology, grain, _CHOICE | _EVERYWHERE, fiber=along(grain, (1, 0, 0)))
    assert sorted(unit.get_state().state) == ["activation_time", "gate", "increments", "phi", "substep_ms"]
    expected, gate = _duration(_CELL)
    before, time = unit.get("potential"), 0
    while (unit.get("potential") >= -67.0).all():
        before = unit.get("potential")
        unit.do_step(1e-3 * time, 1e-3)
        time += 1
    after = unit.get("potential")
    found = time - 1 + (before.mean() + 67.0) / (before.mean() - after.mean())
    assert found == pytest.approx(expected, abs=0.1)
    # Within the millisecond of the crossing the gate opens by up to 0.85/120.
    assert unit.get_state().state["gate"].mean() == pytest.approx(gate, abs=0.01)


def test_the_time_constants_follow_the_time_scale(grain: Mesh, started: Any, along: Any) -> None:
    """What activates last would not be the first to repolarise."""
    fiber, ends = along(grain, (1, 0, 0)), []
    for scale in (1.0, 0.5):
        # With the apex a kilometre away t_a = 0 everywhere, and β_t/β = 1 + 12/63 of the reduction.
        reduction = (scale - 1.0) * 63.0 / 12.0
        parameters = _CHOICE | _EVERYWHERE
        parameters |= {"time_scale_reduction": reduction, "apex_z_mm": -1e6, "longest_substep_ms": 0.1 * scale}
        unit = started(Electrophysiology, grain, parameters, fiber=fiber)
        unit.do_step(0.0, 0.1 * scale)
        ends.append(unit.get("potential"))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-3)


def test_wave_without_a_gate_has_the_speed_of_its_closed_form(started: Any, slopes) -> None:
    # With h = 1 for good, φ' = −φ(φ − a)(φ − b)/τ_in, a and b = (1 ∓ √(1 − 4τ_in/τ_out))/2: the front from b to 0 has
    # the speed √(d/(2τ_in)) (b − 2a).
    root = sqrt(1.0 - 4.0 * 0.3 / 6.0)
    exact = sqrt(1.1 / (2.0 * 0.3)) * ((1.0 + root) / 2.0 - (1.0 - root))
    sizes, errors = [0.6, 0.3, 0.15], []
    for size in sizes:
        mesh = build("strand", size)
        parameters = _CHOICE | {
            "gate_opening_time_ms": 1e9,
            "gate_closing_time_ms": 1e9,
            "stimulus_x_min_mm": -1.0,
            "stimulus_x_max_mm": 5.0,
            "longest_substep_ms": 0.02,
        }
        unit = started(Electrophysiology, mesh, parameters, fiber=np.tile([1.0, 0.0, 0.0], (mesh.elements, 1)))
        unit.do_step(0.0, 0.05)
        x, times = mesh.points[:, 0], unit.get("activation_time")
        middle = (x > 20.0) & (x < 40.0)
        errors.append(abs(np.polyfit(times[middle], x[middle], 1)[0] / exact - 1.0))
    orders = slopes(sizes, errors)
    assert errors[-1] < 1e-3
    assert ((orders > 1.7) & (orders < 2.4)).all(), (orders, errors)


def test_substep_too_long_for_its_upstroke_is_refused(grain: Mesh, started: Any, along: Any) -> None:
    fiber = along(grain, (1, 0, 0))
    longest = 1.0 / (1.0 / 0.3 + 1.0 / 6.0)
    started(Electrophysiology, grain, _CHOICE | {"longest_substep_ms": 0.999 * longest}, fiber=fiber)
    with pytest.raises(InvalidInput, match="longest_substep_ms"):
        started(Electrophysiology, grain, _CHOICE | {"longest_substep_ms": 1.001 * longest}, fiber=fiber)


def test_parameters_of_a_model_that_is_not_chosen_are_warned_of(grain: Mesh) -> None:
    """Somebody would wonder for a day why tau_in has no influence."""
    unit = Electrophysiology(grain)
    unit.instantiate({"inward_time_ms": 0.2, "excitation_rate": 7.0})
    assert [warning for warning in unit.warnings() if "inward_time_ms" in warning]
    assert not [warning for warning in unit.warnings() if "excitation_rate" in warning]
