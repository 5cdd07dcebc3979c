"""If these fail, displacements within the elements are not what their nodes say, and finer meshes do not help."""

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mechanics.elements.linear import linear
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.laws.guccione import Guccione
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.cavity_pressure import CavityPressure
from cardiac_cosim.units.mechanics.loads.springs import Springs
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.cavity import cavity_faces
from manufactured import FIBER, SHEET, body_force, exact, exact_gradient, exact_tension, nominal_stress
from scipy.sparse.linalg import spsolve
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet

_ORDERS = pytest.mark.parametrize("order", [1, 2])
_LAWS = (NeoHooke(), HolzapfelFiber())
_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
#: F − 1 of a linear displacement.
_LINEAR = np.array([[0.1, 0.05, -0.02], [0.03, -0.1, 0.04], [0.0, 0.02, 0.06]])


def _inner(mesh: Mesh, order: int) -> np.ndarray:
    """The displacement's nodes that are not on the surface."""
    space = ELEMENTS[order](mesh)
    return np.setdiff1d(np.arange(len(space.points)), space.face_nodes(mesh.surface))


def _shape(order: int, at: np.ndarray) -> np.ndarray:
    """Shape functions at barycentric coordinates, shape (points, 4) to (points, element nodes); a second time."""
    if order == 1:
        return at
    return np.column_stack([at * (2.0 * at - 1.0), *(4.0 * at[:, a] * at[:, b] for a, b in _EDGES)])


@_ORDERS
def test_a_patch_of_constant_stress_has_no_force_inside(order: int, cube, along, solid_of) -> None:
    solid = solid_of(cube, _LAWS, order, directions=(along(cube, (0.6, 0.8, 0)), along(cube, (0, 0, 1))))
    displacement = solid.space.points @ _LINEAR.T + [1.0, -2.0, 0.5]
    force = np.linalg.norm(solid.residual(displacement, np.full(cube.nodes, 0.3)).reshape(-1, 3), axis=1)
    inner = _inner(cube, order)
    assert len(inner) == {1: 2, 2: 45}[order]
    assert force[inner].max() < 1e-13
    assert np.median(np.delete(force, inner)) > 1e-3


@_ORDERS
def test_nodes_of_faces_are_nodes_of_their_elements(order: int, cube) -> None:
    space = ELEMENTS[order](cube)
    corners = cube.points[cube.surface]
    middles = [0.5 * (corners[:, a] + corners[:, b]) for a, b in ((0, 1), (1, 2), (2, 0))]
    expected = np.concatenate([corners, np.stack(middles, axis=1)], axis=1)[:, : {1: 3, 2: 6}[order]]
    np.testing.assert_allclose(space.points[space.face_nodes(cube.surface)], expected, atol=1e-14)
    assert len(np.unique(np.round(space.points, 9), axis=0)) == len(space.points)
    np.testing.assert_array_equal(space.nodes[:, :4], cube.cells)
    np.testing.assert_allclose(space.weights.sum(axis=1), cube.volumes, rtol=1e-13)


def test_stretch_is_the_mean_over_an_elements_points(cube, solid_of, frames) -> None:
    # u = (x² , 0, xy)/20 is in the space: its stretch at the points of degree 2, by hand.
    fiber, _ = frames(cube.elements)
    solid = solid_of(cube, _LAWS, 2)
    x, y, _ = solid.space.points.T
    displacement = np.stack([x**2, 0.0 * x, x * y], axis=1) / 20.0
    near = (5.0 - np.sqrt(5.0)) / 20.0
    points = np.einsum("pa,eai->epi", np.full((4, 4), near) + (1.0 - 4.0 * near) * np.eye(4), cube.points[cube.cells])
    gradient = np.broadcast_to(np.eye(3), (*points.shape, 3)).copy()
    gradient[:, :, 0, 0] += points[:, :, 0] / 10.0
    gradient[:, :, 2, 0] += points[:, :, 1] / 20.0
    gradient[:, :, 2, 1] += points[:, :, 0] / 20.0
    stretches = np.linalg.norm(np.einsum("epij,ej->epi", gradient, fiber), axis=2)
    assert np.ptp(stretches, axis=1).max() > 0.01
    np.testing.assert_allclose(solid.stretch(displacement), stretches.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(solid.volume_ratio(displacement), np.linalg.det(gradient).min(axis=1), rtol=1e-12)


@_ORDERS
@pytest.mark.parametrize("laws", [(NeoHooke(),), (Guccione(),)], ids=["neo_hooke", "guccione"])
def test_residual_and_tangent_of_the_whole_solid_are_derivatives(laws, order: int, cube, solid_of, slopes) -> None:
    # Tissue, active stress, a pressure whose rim is held, and springs. (Fibres that go slack have kinks.)
    rim = ELEMENTS[order](cube).points
    solid = solid_of(
        cube,
        laws,
        order,
        lambda at: np.repeat((at[:, 2:] > rim[:, 2].mean()) & (at[:, :1] > 0.3), 3, axis=1),
        pressures=[lambda space: CavityPressure(space, cube.surface)],
        supports=[(0.05, lambda space: Springs(space, cube.boundary("top")))],
    )
    random = np.random.default_rng(13)
    shape = solid.space.points.shape
    displacement = np.where(solid.free, random.uniform(-0.04, 0.04, shape), 0.0)
    direction = np.where(solid.free, random.standard_normal(shape), 0.0)
    loads = np.append(random.uniform(0.0, 0.2, cube.nodes), 0.03)
    force = solid.residual(displacement, loads)
    change = solid.tangent(displacement, loads).full() @ direction[solid.free]
    steps = (4e-3, 2e-3, 1e-3)
    errors: tuple[list[float], list[float]] = ([], [])
    for step in steps:
        up, down = (solid.energy_and_residual(displacement + s * direction, loads) for s in (step, -step))
        errors[0].append(abs((up[0] - down[0]) / (2.0 * step) - force @ direction[solid.free]))
        errors[1].append(np.abs((up[1] - down[1]) / (2.0 * step) - change).max())
    for error, size in zip(errors, (abs(force @ direction[solid.free]), np.abs(change).max()), strict=True):
        assert error[-1] < 2e-2 * size
        orders = slopes(steps, error)
        assert ((orders > 1.9) & (orders < 2.1)).all(), orders


# --- convergence under refinement ----------------------------------------------------------------------------------

_PRESSURE = 0.05
#: Exact to degree 6: what is integrated here is not to be blamed.
_PLACES, _WEIGHTS = get_quadrature(RefTet, 6)
_BARYCENTRIC = np.column_stack([1.0 - _PLACES.sum(axis=0), *_PLACES])


def _l2_error(order: int, cells: int, box, along, solid_of) -> float:
    """Distance in L2 from the manufactured solution; its top carries a pressure, all other sides are prescribed."""
    axis = np.linspace(0.0, 1.0, cells + 1)
    mesh = box(axis, axis, axis, top=lambda at: at[:, 2] > 1.0 - 1e-9)
    solid = solid_of(
        mesh,
        _LAWS,
        order,
        lambda at: np.repeat(
            (at[:, :2] * (1.0 - at[:, :2]) > 1e-9).all(axis=1, keepdims=True) & (at[:, 2:] > 0.0), 3, 1
        ),
        directions=(along(mesh, FIBER), along(mesh, SHEET)),
        pressures=[lambda space: CavityPressure(space, mesh.boundary("top"))],
    )
    space, shape = solid.space, _shape(order, _BARYCENTRIC)
    load = np.zeros_like(space.points)
    for weight, vertices, values in zip(6.0 * _WEIGHTS, _BARYCENTRIC, shape, strict=True):
        force = weight * mesh.volumes[:, None] * body_force(np.einsum("a,eai->ei", vertices, mesh.points[mesh.cells]))
        for node, value in enumerate(values):
            np.add.at(load, space.nodes[:, node], value * force)
    # What the exact traction is beyond −p cof(F) N.
    faces, rule = mesh.boundary("top"), space.face_rule
    twice_area = np.linalg.norm(np.cross(*np.diff(mesh.points[faces], axis=1).transpose(1, 0, 2)), axis=1)
    nodes = space.face_nodes(faces)
    for weight, values in zip(rule.weights, rule.values, strict=True):
        at = np.einsum("a,fai->fi", values, space.points[nodes])
        gradient = exact_gradient(at)
        cofactor = np.linalg.det(gradient)[:, None, None] * np.linalg.inv(gradient).transpose(0, 2, 1)
        traction = nominal_stress(at)[:, :, 2] + _PRESSURE * cofactor[:, :, 2]
        for node, value in enumerate(values):
            np.add.at(load, nodes[:, node], value * weight * twice_area[:, None] * traction)
    loads = np.append(exact_tension(mesh.points), _PRESSURE)
    displacement = exact(space.points)
    displacement[solid.free] *= 0.8
    for _ in range(20):
        residual = solid.residual(displacement, loads) - load[solid.free]
        if np.abs(residual).max() < 1e-12:
            break
        displacement[solid.free] -= spsolve(solid.tangent(displacement, loads).full(), residual)
    assert np.abs(residual).max() < 1e-12
    square = 0.0
    for weight, vertices, values in zip(6.0 * _WEIGHTS, _BARYCENTRIC, shape, strict=True):
        at = np.einsum("a,eai->ei", vertices, mesh.points[mesh.cells])
        off = np.einsum("a,eai->ei", values, displacement[space.nodes]) - exact(at)
        square += weight * mesh.volumes @ np.sum(off**2, axis=1)
    return float(np.sqrt(square))


@pytest.mark.parametrize(("order", "cells"), [(1, (4, 8, 12)), (2, (2, 4, 6))])
def test_displacement_converges_at_one_order_more_than_its_elements_have(
    order: int, cells: tuple[int, ...], box, along, solid_of, slopes
) -> None:
    errors = [_l2_error(order, count, box, along, solid_of) for count in cells]
    orders = slopes([1.0 / count for count in cells], errors)
    assert ((orders > order + 0.8) & (orders < order + 1.2)).all(), orders


# --- the unit ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ventricle(started) -> tuple[Mesh, dict[str, np.ndarray]]:
    """A coarse left ventricle with its fibres."""
    mesh = registry.build("left_ventricle", 12.0)
    fibers = started(FiberGenerator, mesh)
    return mesh, {name: fibers.get(name) for name in ("fiber", "sheet")}


def test_a_heart_of_quadratic_elements_contracts_and_says_so_as_others_do(ventricle, started) -> None:
    mesh, directions = ventricle
    found = {}
    for order in (1, 2):
        unit = started(Mechanics, mesh, {"element_order": order}, **directions)
        before = float(unit.get("lv_volume"))
        for number, level in enumerate((40.0, 80.0)):
            unit.set("active_stress", np.full(mesh.nodes, level))
            unit.do_step(0.001 * number, 0.001)
        assert unit.get("displacement").shape == (mesh.nodes, 3)
        assert unit.get("stretch").shape == (mesh.elements,)
        assert not unit.get("displacement")[mesh.boundary_nodes("base")].any()
        found[order] = before - float(unit.get("lv_volume")), unit
        facetted = CavityPressure(linear(mesh), cavity_faces(mesh, ("lv_endocardium",)))
        assert before == pytest.approx(1e-3 * facetted.volume(np.zeros_like(mesh.points)), rel=1e-12)
    # Linear elements resist more than the tissue does.
    assert 1.0 < found[1][0] < found[2][0] < 1.5 * found[1][0]
    assert np.corrcoef(found[1][1].get("stretch"), found[2][1].get("stretch"))[0, 1] > 0.8


def test_a_step_of_quadratic_elements_can_be_taken_back(ventricle, started) -> None:
    # Their state has more nodes than the mesh.
    mesh, directions = ventricle
    unit = started(Mechanics, mesh, {"element_order": 2}, **directions)
    saved, bits = unit.get_state(), []
    for _ in range(2):
        unit.set_state(saved)
        unit.set("active_stress", np.full(mesh.nodes, 40.0))
        unit.do_step(0.0, 0.001)
        bits.append(unit.get("displacement").tobytes() + unit.get("stretch").tobytes())
    assert bits[0] == bits[1]


def test_orders_beyond_two_are_refused(ventricle, started) -> None:
    mesh, directions = ventricle
    with pytest.raises(InvalidInput, match="element_order"):
        started(Mechanics, mesh, {"element_order": 3}, **directions)
