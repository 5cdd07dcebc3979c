"""If these fail, the explicit step that is to show its limit has another one, or fails without saying so."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.electrophysiology.explicit_step import ExplicitSteps
from cardiac_cosim.units.electrophysiology.monodomain import Conduction, Monodomain
from cardiac_cosim.units.electrophysiology.time_scale import TimeScale
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.mesh import Mesh
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

_VARIANTS = {
    "quadrature": {"mass_matrix": "consistent", "ionic_current": "quadrature"},
    "nodal": {"mass_matrix": "consistent", "ionic_current": "nodal"},
    "lumped": {"mass_matrix": "lumped"},
}
each_variant = pytest.mark.parametrize("variant", _VARIANTS)


@pytest.fixture(scope="module")
def bar(box: Any) -> Mesh:
    return box(np.linspace(0.0, 12.0, 5), [0.0, 3.0], [-3.0, 0.0])


@each_variant
def test_the_explicit_step_is_of_second_order_and_solves_the_same_equation(
    variant: str, bar: Mesh, started: Any, along: Any, slopes: Any, monodomain_equations: Any
) -> None:
    fiber, stretch = along(bar, (0.8, 0.6, 0.0)), np.linspace(0.95, 1.15, bar.elements)
    parameters = {"stimulus_x_max_mm": 5.0, "stimulus_depth_mm": 10.0, "diffusion_step": "explicit"}
    errors, substeps, end = [], (0.1, 0.05, 0.025), 4.0
    for substep in substeps:
        given = parameters | _VARIANTS[variant] | {"longest_substep_ms": substep}
        unit = started(Electrophysiology, bar, given, fiber=fiber, stretch=stretch)
        begin = np.concatenate([(unit.get("potential") + 80.0) / 100.0, np.zeros(bar.nodes)])
        unit.do_step(0.0, 1e-3 * end)
        equations = monodomain_equations(bar, fiber, stretch, TimeScale(), variant)
        exact = solve_ivp(equations, (0.0, end), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[: bar.nodes, -1]
        errors.append(float(np.abs((unit.get("potential") + 80.0) / 100.0 - exact).max()))
    np.testing.assert_allclose(slopes(substeps, errors), 2.0, atol=0.15)


@pytest.mark.parametrize("variant", ["nodal", "lumped"])
@pytest.mark.parametrize("side", [0.5, 0.99, 1.01, 1.5])
def test_a_mode_is_multiplied_by_the_polynomial_of_the_method(variant: str, side: float, bar: Mesh, along: Any) -> None:
    conduction = Conduction(**_VARIANTS[variant])
    equation = Monodomain(bar, along(bar, (1.0, 0.0, 0.0)), TimeScale(), conduction)
    rates, modes = eigh(equation.diffusion.toarray(), equation.mass.toarray())
    step_ms = side * 2.0 / rates[-1]

    def nothing(phi: np.ndarray, recovery: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros_like(phi), np.zeros_like(recovery)

    step = ExplicitSteps(equation)(equation, np.ones(bar.elements), step_ms, nothing)
    after, grown = step(np.stack([modes[:, -1], np.zeros(bar.nodes)]), np.zeros((2, bar.nodes)))
    factor = 1.0 - 2.0 * side + 2.0 * side * side
    assert (factor > 1.0) == (side > 1.0)
    np.testing.assert_allclose(after[0], factor * modes[:, -1], atol=1e-12 * np.abs(modes).max())
    np.testing.assert_allclose(grown[1], after[0] - modes[:, -1], atol=1e-12 * np.abs(modes).max())


@pytest.mark.parametrize("variant", ["nodal", "lumped"])
def test_substeps_beyond_the_limit_of_diffusion_are_refused(variant: str, bar: Mesh, started: Any, along: Any) -> None:
    fiber = along(bar, (1.0, 0.0, 0.0))
    parameters = {"diffusion_step": "explicit", "stimulus_depth_mm": 10.0, **_VARIANTS[variant]}
    # A cell's fastest rate, c/beta_t, where the time scale is smallest.
    time_scale = TimeScale()
    equation = Monodomain(bar, fiber, time_scale, Conduction(**_VARIANTS[variant]))
    fastest = eigh(equation.diffusion.toarray(), equation.mass.toarray(), eigvals_only=True)[-1]
    limit = 2.0 / (fastest + 8.0 / time_scale(bar.points[:, 2]).min())
    started(Electrophysiology, bar, parameters | {"longest_substep_ms": 0.999 * limit}, fiber=fiber)
    with pytest.raises(InvalidInput, match=r"'longest_substep_ms' is .* explicit diffusion .* explicit_limit: ignored"):
        started(Electrophysiology, bar, parameters | {"longest_substep_ms": 1.001 * limit}, fiber=fiber)
    ignored = {"longest_substep_ms": 1.001 * limit, "explicit_limit": "ignored"}
    started(Electrophysiology, bar, parameters | ignored, fiber=fiber)


@pytest.mark.parametrize("diffusion", ["implicit", "explicit"])
def test_what_runs_beyond_its_limit_ends_in_a_failure_and_in_no_number_that_is_none(
    diffusion: str, bar: Mesh, started: Any, along: Any
) -> None:
    parameters = {"diffusion_step": diffusion, "explicit_limit": "ignored", "stimulus_depth_mm": 10.0}
    parameters |= {"longest_substep_ms": 12.0, "stretch_conductance": 0.0}
    unit = started(Electrophysiology, bar, parameters, fiber=along(bar, (1.0, 0.0, 0.0)))
    before = unit.get("potential").copy()
    with pytest.raises(StepFailure, match=r"outside the range of a cell|fell below|not finite"):
        unit.do_step(0.0, 0.6)
    np.testing.assert_array_equal(unit.get("potential"), before)


def test_the_limit_of_the_cells_is_enforced_unless_it_is_to_be_seen(bar: Mesh, started: Any, along: Any) -> None:
    fiber, parameters = along(bar, (1.0, 0.0, 0.0)), {"stimulus_depth_mm": 10.0, "longest_substep_ms": 4.0}
    with pytest.raises(InvalidInput, match=r"does not resolve the upstroke. .* explicit_limit: ignored"):
        started(Electrophysiology, bar, parameters, fiber=fiber)
    unit = started(Electrophysiology, bar, parameters | {"explicit_limit": "ignored"}, fiber=fiber)
    # Nothing else differs: below the limit the bits are the same.
    pair = [
        started(Electrophysiology, bar, {"stimulus_depth_mm": 10.0, "explicit_limit": kind}, fiber=fiber)
        for kind in ("enforced", "ignored")
    ]
    for each in pair:
        each.do_step(0.0, 0.01)
    np.testing.assert_array_equal(pair[0].get("potential"), pair[1].get("potential"))
    unit.do_step(0.0, 0.004)
    assert np.isfinite(unit.get("potential")).all()
