"""If these fail, what is around the heart holds it too softly, too stiffly, or along its surface."""

import numpy as np
import pytest
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.cavity_pressure import CavityPressure
from cardiac_cosim.units.mechanics.loads.springs import Springs
from cardiac_cosim.units.mesh import Mesh
from scipy.optimize import brentq

_ORDERS = pytest.mark.parametrize("order", [1, 2])


@_ORDERS
def test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces(order: int, cube) -> None:
    space = ELEMENTS[order](cube)
    springs = Springs(space, cube.boundary("top"))
    random = np.random.default_rng(5)
    displacement, direction = random.standard_normal((2, *space.points.shape))
    # All is linear or quadratic: central differences are exact.
    step = 0.1
    energies = [springs.energy(displacement + sign * step * direction) for sign in (1.0, -1.0)]
    slope = (energies[0] - energies[1]) / (2.0 * step)
    assert slope == pytest.approx(np.sum(springs.forces(displacement) * direction), rel=1e-10)
    matrices = springs.stiffness(displacement)
    np.testing.assert_allclose(matrices, matrices.transpose(0, 3, 4, 1, 2), atol=1e-15)
    curved = np.einsum("fai,faibj,fbj->", direction[springs.nodes], matrices, direction[springs.nodes])
    assert curved == pytest.approx(np.sum(springs.forces(direction) * direction), rel=1e-12)


@_ORDERS
def test_the_energy_is_half_the_integral_of_the_squared_normal_displacement(order: int, box) -> None:
    # On a face of 3 x 2 mm with N along z: u_z = 1 + x gives ½ · 2 · ∫ (1 + x)² dx = 21; sliding costs nothing.
    grid = np.linspace(0.0, 1.0, 3)
    mesh = box(3.0 * grid, 2.0 * grid, grid, top=lambda at: at[:, 2] > 0.99)
    space = ELEMENTS[order](mesh)
    springs = Springs(space, mesh.boundary("top"))
    displacement = np.random.default_rng(6).standard_normal(space.points.shape)
    displacement[:, 2] = 1.0 + space.points[:, 0]
    assert springs.energy(displacement) == pytest.approx(21.0, rel=1e-12)
    if order == 2:
        displacement[:, 2] = space.points[:, 0] ** 2
        assert springs.energy(displacement) == pytest.approx(3.0**5 / 5.0, rel=1e-12)


@_ORDERS
def test_a_block_pushed_onto_springs_sinks_as_the_closed_form(order: int, box, solid_of) -> None:
    # Held sideways: μ(λ − 1/λ) + λ_L ln λ/λ = −p, and the springs below carry p: they give way by p/k.
    pressure, stiffness = 0.05, 0.02
    stretch = brentq(lambda λ: 0.2 * (λ - 1.0 / λ) + 0.5 * np.log(λ) / λ + pressure, 0.5, 1.0, xtol=1e-15)
    grid = np.linspace(0.0, 1.0, 3)
    mesh = box(grid, grid, grid, top=lambda at: at[:, 2] > 0.99, bottom=lambda at: at[:, 2] < 0.01)

    def upright(at: np.ndarray) -> np.ndarray:
        free = np.zeros(at.shape, dtype=bool)
        free[:, 2] = True
        return free

    solid = solid_of(
        mesh,
        (NeoHooke(),),
        order,
        upright,
        pressures=[lambda space: CavityPressure(space, mesh.boundary("top"))],
        supports=[(stiffness, lambda space: Springs(space, mesh.boundary("bottom")))],
    )
    displacement = np.zeros_like(solid.space.points)
    displacement[:, 2] = (stretch - 1.0) * solid.space.points[:, 2] - pressure / stiffness
    loads = np.append(np.zeros(mesh.nodes), pressure)
    assert np.abs(solid.residual(displacement, loads)).max() < 1e-13
    displacement[:, 2] *= 1.01
    assert np.abs(solid.residual(displacement, loads)).max() > 1e-5
    # Nothing else holds it: the stiffness is that of the springs in series with the block.
    assert np.linalg.eigvalsh(solid.tangent(displacement, loads).full().toarray())[0] > 1e-4


@pytest.fixture(scope="module")
def chambers(two_chambers, along) -> tuple[Mesh, dict[str, np.ndarray]]:
    return two_chambers, {"fiber": along(two_chambers, (0, 0, 1)), "sheet": along(two_chambers, (1, 0, 0))}


@_ORDERS
def test_springs_on_the_epicardium_hold_the_heart_and_stiff_ones_hold_it_still(order: int, chambers, started) -> None:
    mesh, directions = chambers
    faces = mesh.boundary("epicardium")
    corners = mesh.points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    uplift, outwards = [], []
    for stiffness in (0.0, 50.0, 1e6):
        parameters = {"epicardium_stiffness_kPa_per_mm": stiffness, "element_order": order}
        unit = started(Mechanics, mesh, parameters, active_stress=np.full(mesh.nodes, 60.0), **directions)
        moved = unit.get("displacement")[faces].mean(axis=1)
        uplift.append(float(unit.get("apex_uplift")))
        outwards.append(np.abs(np.sum(moved * normal, axis=1)).max())
    assert uplift[0] > 0.5
    assert 0.05 * uplift[0] < uplift[1] < 0.9 * uplift[0]
    assert outwards[0] > 0.5
    assert outwards[2] < 0.01
    # The surface may slide along itself.
    assert np.abs(moved - np.sum(moved * normal, axis=1)[:, None] * normal).max() > 0.02
