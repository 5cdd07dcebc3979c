"""If these fail, equilibria are found by luck, depend on the linear solver at hand, or cost far more than they need."""

from importlib.util import find_spec

import numpy as np
import pytest
from cardiac_cosim.units import kernels
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mechanics.bulk import Tissue
from cardiac_cosim.units.mechanics.elements.linear import linear
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares
from cardiac_cosim.units.mechanics.solid import Solid
from cardiac_cosim.units.mechanics.solvers import choice
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver
from cardiac_cosim.units.mechanics.solvers.factored import NotConverged
from cardiac_cosim.units.mechanics.solvers.factorisation import NotFactorised
from cardiac_cosim.units.mechanics.solvers.predictor import Predictor
from cardiac_cosim.units.mechanics.stiffness import Stiffness
from cardiac_cosim.units.mesh import Mesh

#: Linear solvers, and what they leave of a residual.
_SOLVERS = {"superlu": 1e-12, "multigrid": 1.1e-2} | ({"supernodal": 1e-4} if find_spec("rslab") else {})

#: Stretch beyond 1 at which resting tissue fires by itself (docs/model.md, Numbers to verify against).
_FALSE_BEAT = 3.3e-5


@pytest.fixture(scope="module")
def solid(box, along) -> Solid:
    """A block held at one side, some of whose nodes can move along one axis only."""
    axis = np.linspace(0.0, 2.0, 5)
    mesh = box(axis, axis, axis)
    fiber, sheet = along(mesh, (0.6, 0.8, 0.0)), along(mesh, (0.0, 0.0, 1.0))
    free = np.ones((mesh.nodes, 3), dtype=bool)
    free[mesh.points[:, 0] == 0.0] = False
    free[mesh.points[:, 1] == 0.0, 1] = False
    return Solid(linear(mesh), Tissue(fiber, sheet, (NeoHooke(),), ActiveShares().tensor(fiber, sheet)), free)


@pytest.mark.parametrize("kind", _SOLVERS)
def test_linear_solver_solves(kind: str, solid: Solid) -> None:
    tangent = solid.tangent(np.zeros_like(solid.space.points), np.full(solid.loads, 0.1))
    right = np.random.default_rng(1).standard_normal(solid.unknowns)
    before = right.copy()
    solution = LinearSolver(linear_solver=kind).factorisation(solid)(tangent)(right)
    np.testing.assert_array_equal(right, before)
    left = np.linalg.norm(tangent.full() @ solution - right) / np.linalg.norm(right)
    assert left < _SOLVERS[kind]


@pytest.mark.parametrize("kind", _SOLVERS)
def test_linear_solver_repeats_its_bits(kind: str, solid: Solid) -> None:
    # pyamg starts from random numbers, and leaves those of other people alone.
    tangent = solid.tangent(np.zeros_like(solid.space.points), np.full(solid.loads, 0.1))
    right, drawn = np.random.default_rng(1).standard_normal(solid.unknowns), []
    solutions = []
    for seed in (1, 2):
        np.random.seed(seed)  # noqa: NPY002
        solutions.append(LinearSolver(linear_solver=kind).factorisation(solid)(tangent)(right).tobytes())
        drawn.append(np.random.random())  # noqa: NPY002
    assert solutions[0] == solutions[1]
    np.random.seed(2)  # noqa: NPY002
    assert drawn[1] == np.random.random()  # noqa: NPY002


def test_triangle_is_that_of_the_whole_matrix(solid: Solid) -> None:
    random = np.random.default_rng(2)
    displacement = np.where(solid.free, random.uniform(-0.05, 0.05, solid.free.shape), 0.0)
    tangent = solid.tangent(displacement, random.uniform(0.0, 0.2, solid.loads))
    full, lower = tangent.full().toarray(), tangent.lower().toarray()
    np.testing.assert_array_equal(np.tril(full), lower)
    np.testing.assert_array_equal(full, full.T)


@pytest.mark.parametrize("kind", sorted(set(_SOLVERS) - {"superlu"}))
def test_matrix_that_is_not_positive_definite_is_no_preconditioner(kind: str, solid: Solid) -> None:
    tangent = solid.tangent(np.zeros_like(solid.space.points), np.zeros(solid.loads))
    turned = Stiffness(tangent.pattern, -tangent.blocks)
    with pytest.raises(NotFactorised, match="not positive definite"):
        LinearSolver(linear_solver=kind).factorisation(solid)(turned)


@pytest.mark.parametrize("kind", _SOLVERS)
def test_matrix_of_no_numbers_is_not_factorised(kind: str, solid: Solid) -> None:
    tangent = solid.tangent(np.zeros_like(solid.space.points), np.zeros(solid.loads))
    tangent.blocks[-1] = np.nan
    with pytest.raises(NotFactorised):
        LinearSolver(linear_solver=kind).factorisation(solid)(tangent)


def test_without_supernodal_factors_scipy_serves_and_says_so(solid: Solid, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "find_spec", lambda package: None if package == "rslab" else find_spec(package))
    solver = LinearSolver()
    assert "SuperLU" in solver.factorisation(solid).name
    assert any("pip install rslab" in sentence for sentence in solver.fallback())
    # Asked for by name it is no fallback, and an error where it is missing.
    assert list(LinearSolver(linear_solver="superlu").fallback()) == []
    monkeypatch.setitem(__import__("sys").modules, "rslab", None)
    with pytest.raises(InvalidInput, match="'linear_solver' is supernodal, and its package is not installed"):
        LinearSolver(linear_solver="supernodal").factorisation(solid)


def test_meshes_too_large_for_factors_get_multigrid(solid: Solid, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "MOST_FACTORISED", dict.fromkeys(choice.MOST_FACTORISED, solid.unknowns - 1))
    assert "multigrid" in LinearSolver().factorisation(solid).name
    monkeypatch.setattr(choice, "MOST_FACTORISED", dict.fromkeys(choice.MOST_FACTORISED, solid.unknowns))
    assert "multigrid" not in LinearSolver().factorisation(solid).name


# --- the first guess -----------------------------------------------------------------------------------------------


@pytest.fixture(params=[*kernels.available(), kernels.WITHOUT])
def predictor(request: pytest.FixtureRequest) -> Predictor:
    """Of twenty loads, the last of which weighs as much as three others."""
    with kernels.using(request.param):
        return Predictor(20, 19, 3.0)


def test_guess_is_exact_where_displacements_follow_linearly_and_the_change_is_in_the_span(
    predictor: Predictor,
) -> None:
    random = np.random.default_rng(4)
    response = random.standard_normal((12, 3, 20))
    changes = list(random.standard_normal((4, 20)))
    moved = [response @ change for change in changes]
    new = 0.3 * changes[0] - 2.0 * changes[1] + changes[3]
    np.testing.assert_allclose(predictor(new, changes, moved), response @ new, atol=1e-12)
    # Of what is outside of the span nothing is known.
    weights = np.where(np.arange(20) < 19, 1.0, 3.0)
    basis, _ = np.linalg.qr((weights * np.array(changes)).T)
    outside = random.standard_normal(20)
    outside -= basis @ (basis.T @ outside)
    np.testing.assert_allclose(predictor(outside / weights, changes, moved), 0.0, atol=1e-12)


def test_guess_does_not_blow_noise_up(predictor: Predictor) -> None:
    # Changes that are the same but for rounding, with displacements that are the same but for a tolerance.
    random = np.random.default_rng(5)
    change, moved = random.standard_normal(20), random.standard_normal((12, 3))
    changes = [change * (1.0 + 1e-9 * random.standard_normal(20)) for _ in range(4)]
    found = predictor(2.0 * change, changes, [moved + 1e-6 * random.standard_normal(moved.shape) for _ in changes])
    np.testing.assert_allclose(found, 2.0 * moved, atol=1e-5)
    nothing = np.zeros(20)
    assert not predictor(change, [nothing] * 4, [np.zeros((12, 3))] * 4).any()


# --- equilibria of a heart -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def contraction(heart: Mesh, started):
    """Stretch and displacement of the heart after active stress has crossed it as a wave, by parameters."""
    fibers = started(FiberGenerator, heart)
    directions = {name: fibers.get(name) for name in ("fiber", "sheet")}

    def contracted(**parameters: object) -> tuple[np.ndarray, list[np.ndarray]]:
        unit = started(Mechanics, heart, parameters, **directions)
        stretches = []
        for number in range(12):
            front = -6.0 * number
            unit.set("active_stress", 300.0 / (1.0 + np.exp(-(heart.points[:, 2] - front) / 4.0)))
            unit.do_step(0.001 * number, 0.001)
            stretches.append(unit.get("stretch"))
        return unit.get("displacement"), stretches

    return contracted


@pytest.fixture(scope="module")
def exact(contraction) -> tuple[np.ndarray, list[np.ndarray]]:
    return contraction(equilibrium_tolerance=1e-10)


@pytest.mark.parametrize("kind", sorted(set(_SOLVERS) - {"multigrid"}))
def test_equilibria_do_not_depend_on_the_linear_solver(kind: str, contraction, exact) -> None:
    displacement, _ = contraction(linear_solver=kind, equilibrium_tolerance=1e-10)
    np.testing.assert_allclose(displacement, exact[0], rtol=0.0, atol=1e-8)


def test_default_tolerance_is_far_from_starting_beats(contraction, exact) -> None:
    _, stretches = contraction()
    errors = [np.abs(found - true).max() for found, true in zip(stretches, exact[1], strict=True)]
    # The tolerance is met, and is not met by chance: somewhere it is used.
    assert 1e-10 < max(errors) < _FALSE_BEAT / 30.0
    _, loose = contraction(equilibrium_tolerance=9e-3)
    assert max(np.abs(found - true).max() for found, true in zip(loose, exact[1], strict=True)) > _FALSE_BEAT


def test_step_from_a_saved_state_repeats_its_bits_with_other_factors_at_hand(heart: Mesh, started) -> None:
    # Predictor, factors and their age are part of the state; factors that another step has left are not.
    fibers = started(FiberGenerator, heart)
    directions = {name: fibers.get(name) for name in ("fiber", "sheet")}
    unit, other = (started(Mechanics, heart, **directions) for _ in range(2))

    def step(of, number: int) -> bytes:
        of.set("active_stress", 300.0 / (1.0 + np.exp(-(heart.points[:, 2] + 6.0 * number) / 4.0)))
        of.do_step(0.001 * number, 0.001)
        return of.get("displacement").tobytes()

    for number in range(4):
        step(unit, number)
    saved = unit.get_state()
    ends = [step(unit, number) for number in range(4, 9)]
    unit.set_state(saved)
    assert [step(unit, number) for number in range(4, 9)] == ends
    other.set_state(other.deserialize(unit.serialize(saved)))
    assert [step(other, number) for number in range(4, 9)] == ends


def test_newtons_method_takes_over_and_stops_where_it_is_told(
    heart: Mesh, started, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A safeguard that never ran, or ran for ever, would be found on the day that it is needed.
    def fails(*_: object) -> None:
        raise NotConverged("not today")

    fibers = started(FiberGenerator, heart)
    directions = {name: fibers.get(name) for name in ("fiber", "sheet")}
    expected = started(Mechanics, heart, active_stress=np.full(heart.nodes, 100.0), **directions)
    monkeypatch.setattr("cardiac_cosim.units.mechanics.solvers.quasi_newton.QuasiNewton.solve", fails)
    found = started(Mechanics, heart, active_stress=np.full(heart.nodes, 100.0), **directions)
    np.testing.assert_allclose(found.get("displacement"), expected.get("displacement"), rtol=0.0, atol=1e-5)
    with pytest.raises(StepFailure, match="after 1 iterations"):
        started(Mechanics, heart, {"newton_iterations": 1}, active_stress=np.full(heart.nodes, 100.0), **directions)


def test_equilibrium_costs_no_newton_steps_in_a_beat(contraction, monkeypatch: pytest.MonkeyPatch) -> None:
    # The safeguarded method behind would hide a fast one that never works.
    def never(*_: object) -> None:
        raise AssertionError("Newton's method was needed")

    monkeypatch.setattr("cardiac_cosim.units.mechanics.solvers.newton.Newton.solve", never)
    contraction()


# --- without safeguards --------------------------------------------------------------------------------------------


@pytest.fixture
def held(started):
    """A piece of wall, after its active stress went from 0 to a number of kPa in one step."""
    wall = build("slab", 10.0)
    fibers = started(FiberGenerator, wall)
    directions = {name: fibers.get(name) for name in ("fiber", "sheet")}

    def contracted(tension_kPa: float, **parameters: object) -> Mechanics:
        unit = started(Mechanics, wall, parameters, **directions)
        unit.set("active_stress", np.full(wall.nodes, tension_kPa))
        unit.do_step(0.0, 0.001)
        return unit

    return contracted


def test_plain_newton_finds_what_the_safeguarded_methods_find(held) -> None:
    plain = held(50.0, safeguards="off", equilibrium_tolerance=1e-10)
    safe = held(50.0, equilibrium_tolerance=1e-10)
    np.testing.assert_allclose(plain.get("displacement"), safe.get("displacement"), rtol=0.0, atol=1e-9)


def test_plain_newton_fails_under_a_load_that_safeguards_bear(held) -> None:
    # What a map of increments of the active stress shows: it is the first step that goes too far.
    with pytest.raises(StepFailure, match=r"It was tried without safeguards; use safeguards: on"):
        held(500.0, safeguards="off")
    assert held(500.0).get("stretch").min() < 0.7
    # On the other side of the limit it needs none.
    assert held(300.0, safeguards="off").get("stretch").min() < 0.8


def test_plain_newton_takes_full_steps_with_a_new_tangent_each(held, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = {"tangent": 0, "residual": 0}
    for name in counts:
        kept = getattr(Solid, name)

        def counted(self: Solid, *given: np.ndarray, name: str = name, kept=kept) -> object:
            counts[name] += 1
            return kept(self, *given)

        monkeypatch.setattr(Solid, name, counted)
    monkeypatch.setattr(Solid, "energy_and_residual", None)
    held(50.0, safeguards="off", equilibrium_tolerance=1e-9, linear_solver="superlu")
    # At rest a residual; then, quadratically, from a load of 50 kPa to nine digits.
    assert counts["residual"] == counts["tangent"] + 2
    assert 3 <= counts["tangent"] <= 6


def test_plain_newton_stops_where_it_is_told(held) -> None:
    with pytest.raises(StepFailure, match="after 2 iterations"):
        held(50.0, safeguards="off", newton_iterations=2, equilibrium_tolerance=1e-10)
