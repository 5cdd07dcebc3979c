"""If these fail, compiled kernels compute something else than NumPy: which heart one gets depends on the machine."""

import numpy as np
import pytest
from cardiac_cosim.units import kernels
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.mechanics.bulk import NumpyBulk, Tissue
from cardiac_cosim.units.mechanics.compiled_bulk import CompiledBulk, bulk
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.elements.space import Space
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares
from cardiac_cosim.units.mechanics.solvers.limited_memory import LimitedMemory
from cardiac_cosim.units.mechanics.stiffness import StiffnessPattern
from cardiac_cosim.units.mesh import Mesh
from scipy.spatial.transform import Rotation

_VARIANTS = kernels.available()
_needs_kernels = pytest.mark.skipif(not _VARIANTS, reason="the kernels were not compiled")


@pytest.fixture(scope="module")
def mesh(box) -> Mesh:
    """108 distorted tetrahedra: six blocks of sixteen and three quarters of one."""

    def distorted(points: np.ndarray) -> np.ndarray:
        return points + 0.06 * np.sin(3.0 * points[:, [1, 2, 0]] + 1.0)

    return box([0, 1, 2, 3], [0, 1, 2], [0, 1, 2, 3], mapped=distorted)


def _parts(mesh: Mesh, order: int) -> tuple[Space, Tissue, StiffnessPattern]:
    frames = Rotation.random(mesh.elements, rng=3).as_matrix()
    fiber, sheet = frames[:, 0], frames[:, 1]
    space = ELEMENTS[order](mesh)
    tissue = Tissue(fiber, sheet, (NeoHooke(), HolzapfelFiber()), ActiveShares().tensor(fiber, sheet))
    free = np.ones((len(space.points), 3), dtype=bool)
    free[:3] = False
    return space, tissue, StiffnessPattern(space.nodes, free)


def _deformed(space: Space) -> np.ndarray:
    """A displacement by which about half of the fibres are taut, and as many slack."""
    x, y, z = space.points.T
    return 0.15 * np.stack([np.sin(x + y), np.cos(2.0 * y - z), np.sin(0.7 * z + x)], axis=1)


@_needs_kernels
@pytest.mark.parametrize("order", ELEMENTS)
@pytest.mark.parametrize("variant", _VARIANTS)
def test_tissue_in_compiled_kernels_is_that_of_numpy(variant: str, order: int, mesh: Mesh) -> None:
    space, tissue, pattern = _parts(mesh, order)
    displacement, tension = _deformed(space), np.linspace(0.0, 0.4, mesh.nodes)
    with kernels.using(variant):
        compiled = bulk(space, tissue, pattern)
    oracle = NumpyBulk(space, tissue, pattern)
    assert isinstance(compiled, CompiledBulk)
    taut = oracle.stretch(displacement) > 1.0
    assert 0.2 < taut.mean() < 0.8

    expected, found = oracle.forces(displacement, tension, True), compiled.forces(displacement, tension, True)
    assert expected is not None
    assert found is not None
    assert found[0] == pytest.approx(expected[0], rel=1e-12)
    np.testing.assert_allclose(found[1], expected[1], rtol=0.0, atol=1e-12 * np.abs(expected[1]).max())
    without = compiled.forces(displacement, tension, False)
    assert without is not None
    np.testing.assert_array_equal(without[1], found[1])
    stiffness = oracle.stiffness(displacement, tension)
    tolerance = 1e-12 * np.abs(stiffness).max()
    np.testing.assert_allclose(compiled.stiffness(displacement, tension), stiffness, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(compiled.stretch(displacement), oracle.stretch(displacement), rtol=1e-12)


@_needs_kernels
@pytest.mark.parametrize("variant", _VARIANTS)
def test_inverted_elements_are_seen_wherever_they_are(variant: str, mesh: Mesh) -> None:
    space, tissue, pattern = _parts(mesh, 1)
    with kernels.using(variant):
        compiled = bulk(space, tissue, pattern)
    for element in (0, 17, mesh.elements - 1):
        # The element's last node goes through the opposite face.
        corners = mesh.points[mesh.cells[element]]
        displacement = np.zeros_like(space.points)
        displacement[mesh.cells[element, 3]] = 1.5 * (corners[:3].mean(axis=0) - corners[3])
        assert compiled.forces(displacement, np.zeros(mesh.nodes), True) is None
    displacement = np.zeros_like(space.points)
    displacement[mesh.cells[40, 0]] = np.nan
    assert compiled.forces(displacement, np.zeros(mesh.nodes), False) is None


@_needs_kernels
def test_arrays_that_c_would_misread_are_refused(mesh: Mesh) -> None:
    with kernels.using(_VARIANTS[-1]):
        compiled = bulk(*_parts(mesh, 1))
    tension = np.zeros(mesh.nodes)
    for displacement in (np.zeros((mesh.nodes - 1, 3)), np.zeros((3, mesh.nodes)).T, np.zeros((mesh.nodes, 3), "f4")):
        with pytest.raises(TypeError, match="displacements"):
            compiled.forces(displacement, tension, False)
    with pytest.raises(TypeError, match="tension"):
        compiled.forces(np.zeros((mesh.nodes, 3)), tension[:-1], False)


@_needs_kernels
def test_law_without_a_twin_in_c_is_computed_by_numpy(mesh: Mesh) -> None:
    class Foreign(NeoHooke):
        name = "foreign"

    space, tissue, pattern = _parts(mesh, 1)
    other = Tissue(tissue.fiber, tissue.sheet, (Foreign(), HolzapfelFiber()), tissue.active_tensor)
    with kernels.using(_VARIANTS[-1]):
        assert isinstance(bulk(space, tissue, pattern), CompiledBulk)
        assert isinstance(bulk(space, other, pattern), NumpyBulk)


@pytest.mark.parametrize("variant", [*_VARIANTS, kernels.WITHOUT])
def test_limited_memory_knows_what_the_last_step_showed(variant: str) -> None:
    # The secant equation: the inverse takes the last change of the residual to the step that made it. In a quadratic
    # energy of as few unknowns as it remembers pairs, it finds the minimum.
    random = np.random.default_rng(5)
    factor = random.standard_normal((5, 5))
    matrix, solution = factor @ factor.T + np.eye(5), random.standard_normal(5)
    with kernels.using(variant):
        memory = LimitedMemory(5)
    at = np.zeros(5)
    residual = matrix @ (at - solution)
    for _ in range(60):
        step = memory.step(residual, lambda right: 0.1 * right)
        change = matrix @ step
        memory.remember(step, change)
        np.testing.assert_allclose(memory.step(-change, lambda right: 0.1 * right), step, rtol=1e-9, atol=1e-12)
        at, residual = at + step, residual + change
    np.testing.assert_allclose(at, solution, atol=1e-8)


@_needs_kernels
@pytest.mark.parametrize("variant", _VARIANTS)
def test_limited_memory_in_compiled_kernels_is_that_of_numpy(variant: str) -> None:
    random = np.random.default_rng(6)
    pairs = [(step, step + 0.3 * random.standard_normal(37)) for step in random.standard_normal((9, 37))]
    residual, steps = random.standard_normal(37), []
    for choice in (variant, kernels.WITHOUT):
        with kernels.using(choice):
            memory = LimitedMemory(37)
        for step, change in pairs:
            memory.remember(step, change)
        steps.append(memory.step(residual, lambda right: 0.5 * right))
    np.testing.assert_allclose(steps[0], steps[1], rtol=0.0, atol=1e-12 * np.abs(steps[1]).max())


def test_unknown_variant_is_refused_by_name() -> None:
    with kernels.using("sse9"), pytest.raises(InvalidInput, match=r"COSIM_KERNELS is 'sse9'; .*can be: .*none"):
        kernels.variant()


def test_missing_kernels_are_told_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(kernels.CHOICE, raising=False)
    assert not _VARIANTS or list(kernels.fallback()) == []
    monkeypatch.setattr(kernels, "_library", lambda: None)
    assert kernels.variant() is None
    assert kernels.described() == "NumPy"
    assert any("install a C compiler" in sentence for sentence in kernels.fallback())
    # Who asked for NumPy need not be told.
    with kernels.using(kernels.WITHOUT):
        assert list(kernels.fallback()) == []
