"""If these fail, a stabilised mechanics is in another equilibrium than the one it says, or hardly finds it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units import kernels
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.mechanics.bulk import Tissue
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares
from cardiac_cosim.units.mechanics.solid import Solid
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver
from cardiac_cosim.units.mechanics.solvers.factored import Factored, Factors
from cardiac_cosim.units.mechanics.solvers.newton import Newton
from cardiac_cosim.units.mechanics.solvers.newton_step import newton_step
from cardiac_cosim.units.mechanics.solvers.quasi_newton import QuasiNewton
from cardiac_cosim.units.mechanics.tangent import Tangent

_LAWS = (NeoHooke(),)
each_order = pytest.mark.parametrize("order", ELEMENTS)


def _bent(solid: Solid, size: float = 0.08) -> np.ndarray:
    """A displacement in mm of which no element is inverted."""
    at = solid.space.points
    return np.ascontiguousarray(size * np.sin(at[:, [1, 2, 0]] + [0.0, 1.0, 2.0]) * at[:, [2]])


def _loads(solid: Solid, stiffness: float, reference: float = 0.97) -> np.ndarray:
    """Active stress and stiffness in MPa that vary from node to node, and a reference stretch."""
    vertices = 0.5 + 0.5 * np.sin(np.arange(solid.loads))
    elements = np.full(len(solid.space.nodes), reference) + 0.02 * np.sin(np.arange(len(solid.space.nodes)))
    return np.concatenate([0.1 * vertices, stiffness * (2.0 - vertices), elements])


def _held(at: np.ndarray) -> np.ndarray:
    """All free but the side at z = 0."""
    return np.repeat(at[:, [2]] > 0.1, 3, axis=1)


@each_order
@pytest.mark.parametrize("kind", [*kernels.available(), kernels.WITHOUT])
def test_in_a_homogeneous_deformation_it_is_more_active_stress(kind: str, order: int, cube, solid_of, along) -> None:
    fiber, sheet = along(cube, (0.6, 0.8, 0.0)), along(cube, (0.0, 0.0, 1.0))
    with kernels.using(kind):
        solid = solid_of(cube, _LAWS, order, directions=(fiber, sheet))
        gradient = np.array([[0.9, 0.05, 0.0], [0.02, 0.95, 0.1], [0.0, -0.04, 1.1]])
        displacement = np.ascontiguousarray(solid.space.points @ (gradient - np.eye(3)).T)
        stretch = float(np.linalg.norm(gradient @ fiber[0]))
        ones, stress, stiffness, reference = np.ones(solid.loads), 0.3, 0.7, 0.98
        with_stiffness = np.concatenate([stress * ones, stiffness * ones, np.full(cube.elements, reference)])
        as_stress = (stress + stiffness * (stretch - reference)) * ones
        found = solid.residual(displacement, with_stiffness)
        np.testing.assert_allclose(found, solid.residual(displacement, as_stress), rtol=0.0, atol=1e-13)
        assert np.abs(found - solid.residual(displacement, stress * ones)).max() > 1e-3


@each_order
def test_at_the_reference_nothing_is_added(order: int, cube, solid_of) -> None:
    # That is what makes the fixed point of an iterated coupling the same, to the bit of the stretch.
    solid = solid_of(cube, _LAWS, order)
    displacement = _bent(solid)
    loads = _loads(solid, 0.7)
    loads[-cube.elements :] = solid.stretch(displacement)
    without = solid.residual(displacement, loads[: solid.loads])
    np.testing.assert_allclose(solid.residual(displacement, loads), without, rtol=0.0, atol=1e-14)


def test_without_stiffness_the_bits_are_those_without_the_load(cube, solid_of) -> None:
    solid = solid_of(cube, _LAWS)
    displacement, loads = _bent(solid), _loads(solid, 0.0)
    short = loads[: solid.loads]
    for one, other in zip(
        solid.energy_and_residual(displacement, loads), solid.energy_and_residual(displacement, short), strict=True
    ):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(solid.tangent(displacement, loads).blocks, solid.tangent(displacement, short).blocks)


@each_order
def test_it_is_the_stress_at_the_stretch_around_each_node(order: int, cube, solid_of, started) -> None:
    # The active stress averages by volume; a mechanics that did not would leave an error in every step.
    solid = solid_of(cube, _LAWS, order)
    displacement, loads = _bent(solid), _loads(solid, 0.7)
    stretch = solid.stretch(displacement)
    unit = started(ActiveStress, cube, {"length_dependence": 1.0}, potential=np.full(cube.nodes, 20.0))
    seen = []
    for given in (stretch, loads[-cube.elements :]):
        unit.set("stretch", given)
        unit.do_step(0.0, 100.0)
        seen.append(unit.get("active_stress") / unit.get("active_stiffness"))
    stiffness = loads[solid.loads : -cube.elements]
    by_hand = solid.residual(displacement, loads[: solid.loads] + stiffness * (seen[0] - seen[1]))
    np.testing.assert_allclose(solid.residual(displacement, loads), by_hand, rtol=0.0, atol=1e-13)


@each_order
def test_stretch_changes_as_by_finite_differences(order: int, cube, solid_of) -> None:
    solid = solid_of(cube, _LAWS, order, _held)
    displacement, change = _bent(solid), np.random.default_rng(3).standard_normal(solid.unknowns)
    ahead, behind = (solid.stretch(solid.moved(displacement, size * change)) for size in (1e-6, -1e-6))
    np.testing.assert_allclose(
        solid.stretch_gradient(displacement) @ change, (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-7
    )


def test_the_tangent_is_symmetric_and_has_the_fibres_answer(cube, solid_of) -> None:
    # Where all elements are stretched alike, averages do not matter: what is left is the answer across the fibre.
    fiber, sheet = (np.tile(axis, (cube.elements, 1)) for axis in np.eye(3)[:2])
    tensor = ActiveShares(active_share_sheet=0.0, active_share_normal=0.0).tensor(fiber, sheet)
    free = np.ones((cube.nodes, 3), dtype=bool)
    solid = Solid(ELEMENTS[1](cube), Tissue(fiber, sheet, list(_LAWS), tensor), free)
    ones = np.ones(solid.loads)
    loads = np.concatenate([0.1 * ones, 0.7 * ones, np.ones(cube.elements)])
    displacement, along = (
        np.ascontiguousarray(solid.space.points * axis) for axis in ([-0.1, 0.03, 0.03], [1.0, 0, 0])
    )
    size = 1e-5
    ahead, behind = (solid.residual(displacement + sign * size * along, loads) for sign in (1.0, -1.0))
    full = solid.tangent(displacement, loads).full()
    np.testing.assert_allclose(full @ along.ravel(), (ahead - behind) / (2.0 * size), rtol=0.0, atol=1e-8)
    np.testing.assert_array_equal(full.toarray(), full.toarray().T)
    without = solid.tangent(displacement, loads[: solid.loads]).full() @ along.ravel()
    assert np.abs(full @ along.ravel() - without).max() > 0.1


@each_order
def test_a_newton_step_is_that_of_the_whole_derivative(order: int, cube, solid_of) -> None:
    solid = solid_of(cube, _LAWS, order, _held)
    loads = _loads(solid, 0.7, reference=1.0)
    displacement = np.where(solid.free, _bent(solid, 0.02), 0.0)
    residual = solid.residual(displacement, loads)
    solve = LinearSolver(linear_solver="superlu").factorisation(solid)(solid.tangent(displacement, loads))
    step = newton_step(solid, solve, displacement, loads, residual)
    size = 1e-6
    ahead, behind = (solid.residual(solid.moved(displacement, sign * size * step), loads) for sign in (1.0, -1.0))
    left = (ahead - behind) / (2.0 * size) + residual
    assert np.linalg.norm(left) < 2e-3 * np.linalg.norm(residual)
    # The factors alone are far from it.
    step = solve(-residual)
    ahead, behind = (solid.residual(solid.moved(displacement, sign * size * step), loads) for sign in (1.0, -1.0))
    assert np.linalg.norm((ahead - behind) / (2.0 * size) + residual) > 0.05 * np.linalg.norm(residual)


@each_order
def test_forces_of_the_active_stress_are_what_the_residual_gains_by_it(order: int, cube, solid_of) -> None:
    solid = solid_of(cube, _LAWS, order, _held)
    displacement, loads = _bent(solid), _loads(solid, 0.0)[: solid.loads]
    gained = solid.residual(displacement, loads) - solid.residual(displacement, 0.0 * loads)
    np.testing.assert_allclose(solid.active_forces(displacement) @ loads, gained, rtol=0.0, atol=1e-14)


@each_order
@pytest.mark.parametrize("stiffness", [0.7, -0.7])
def test_an_answer_of_the_whole_tangent_undoes_the_forces_it_answers(
    stiffness: float, order: int, cube, solid_of
) -> None:
    # What is factorised for equilibria leaves out what reaches beyond an element, and what is not symmetric.
    solid = solid_of(cube, _LAWS, order, _held)
    displacement, loads = _bent(solid), _loads(solid, stiffness)
    tension = np.random.default_rng(3).standard_normal(cube.nodes)
    answer = Tangent(solid, displacement, loads).displacement(tension, [])
    size = 1e-4
    ahead, behind = (solid.residual(solid.moved(displacement, sign * size * answer), loads) for sign in (1.0, -1.0))
    forces = solid.active_forces(displacement) @ tension
    left = (ahead - behind) / (2.0 * size) + forces
    assert np.abs(left).max() < 1e-6 * np.abs(forces).max()


def test_a_negative_stiffness_is_in_the_forces_and_not_in_the_tangent(cube, solid_of) -> None:
    # The factors have to stay positive definite.
    solid = solid_of(cube, _LAWS)
    displacement, loads = _bent(solid), _loads(solid, -0.7)
    loads[-cube.elements :] = solid.stretch(displacement)
    short = loads[: solid.loads]
    np.testing.assert_allclose(
        solid.tangent(displacement, loads).blocks, solid.tangent(displacement, short).blocks, rtol=0.0, atol=1e-14
    )
    loads[-cube.elements :] += 0.01
    assert np.abs(solid.residual(displacement, loads) - solid.residual(displacement, short)).max() > 1e-4


# --- how equilibria are found --------------------------------------------------------------------------------------


def _found(method: type, solid: Solid, loads: Sequence[float]) -> int:
    """How many factorisations it takes from rest, or residuals where the method factorises once."""
    spent = 0
    counted = "residual" if method is QuasiNewton else "tangent"
    compute, kept = solid.residual, getattr(solid, counted)

    def counting(*given: Any) -> Any:
        nonlocal spent
        spent += 1
        return kept(*given)

    setattr(solid, counted, counting)
    limit = 1e-8
    factors = Factors(solid, LinearSolver(linear_solver="superlu").factorisation(solid))
    extra = () if method is QuasiNewton else (40,)
    rest = np.zeros_like(solid.space.points)
    found = method(solid, factors, limit, *extra).solve(rest, np.asarray(loads), Factored.here(rest, np.asarray(loads)))
    assert np.abs(compute(found.displacement, np.asarray(loads))).max() <= limit
    return spent


@each_order
@pytest.mark.parametrize(("method", "most"), [(Newton, 8), (QuasiNewton, 40)])
@pytest.mark.parametrize("ratio", [0.5, 5.0, 50.0])
def test_iterations_stay_few_however_large_the_stiffness(
    ratio: float, method: type, most: int, order: int, cube, solid_of
) -> None:
    solid = solid_of(cube, _LAWS, order, _held)
    ones = np.ones(solid.loads)
    loads = np.concatenate([0.05 * ones, ratio * 0.2 * ones, np.ones(cube.elements)])
    assert _found(method, solid, loads) <= most
