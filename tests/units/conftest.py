"""Small meshes, observed orders and a unit's start in one call: what the tests of the physics share."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.unit import Unit
from numpy.typing import ArrayLike
from skfem import MeshTet

#: Of points, shape (points, 3), the mask of those that belong.
Region = Callable[[np.ndarray], np.ndarray]


def _box(
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    keep: Region | None = None,
    mapped: Callable[[np.ndarray], np.ndarray] | None = None,
    **boundaries: Region,
) -> Mesh:
    """Hexahedra of a grid, each cut into six tetrahedra.

    `keep` chooses elements by their centroids and `boundaries` surface faces by their centres, both on the grid;
    `mapped` then moves the nodes, and those that fall together become one.
    """
    grid = MeshTet.init_tensor(*(np.asarray(axis, dtype=float) for axis in (x, y, z)))
    points, cells = grid.p.T.copy(), grid.t.T.copy()
    if keep is not None:
        cells = cells[keep(points[cells].mean(axis=1))]
        used, numbers = np.unique(cells, return_inverse=True)
        points, cells = points[used], numbers.reshape(-1, 4)
    inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0.0
    cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    surface = Mesh(points, cells).surface
    centres = points[surface].mean(axis=1)
    faces = {name: surface[region(centres)] for name, region in boundaries.items()}
    if mapped is not None:
        moved = mapped(points)
        _, first, numbers = np.unique(np.round(moved, 9), axis=0, return_index=True, return_inverse=True)
        numbers = numbers.ravel()
        points, cells = moved[first], numbers[cells]
        faces = {name: numbers[face] for name, face in faces.items()}
        inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0.0
        cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    return Mesh(points, cells, faces)


def _in_lv(at: np.ndarray) -> np.ndarray:
    return (np.abs(at[:, 0] + 5) < 5.1) & (np.abs(at[:, 1]) < 5.1) & (at[:, 2] > -10.1)


def _in_rv(at: np.ndarray) -> np.ndarray:
    return (np.abs(at[:, 0] - 10) < 5.1) & (np.abs(at[:, 1]) < 5.1) & (at[:, 2] > -10.1)


def _two_chambers() -> Mesh:
    def base(at: np.ndarray) -> np.ndarray:
        return at[:, 2] > -0.01

    def septum(at: np.ndarray) -> np.ndarray:
        return _in_rv(at) & (at[:, 0] < 5.01) & ~base(at)

    return _box(
        5.0 * np.arange(-3, 5),
        5.0 * np.arange(-2, 3),
        5.0 * np.arange(-3, 1),
        keep=lambda at: ~(_in_lv(at) | _in_rv(at)),
        base=base,
        lv_endocardium=lambda at: _in_lv(at) & ~base(at),
        rv_endocardium=lambda at: _in_rv(at) & ~septum(at) & ~base(at),
        rv_septum=septum,
        epicardium=lambda at: ~(_in_lv(at) | _in_rv(at) | base(at)),
    )


def _slopes(sizes: Sequence[float], errors: Sequence[float]) -> np.ndarray:
    """Observed orders of convergence between neighbouring `sizes`."""
    return np.diff(np.log(errors)) / np.diff(np.log(sizes))


def _started(kind: type[Unit], mesh: Mesh, parameters: Mapping[str, Any] | None = None, **inputs: ArrayLike) -> Unit:
    unit = kind(mesh)
    unit.instantiate(parameters or {})
    unit.setup_experiment()
    unit.enter_initialization_mode()
    for name, value in inputs.items():
        unit.set(name, value)
    unit.exit_initialization_mode()
    return unit


#: The points of the tetrahedron's rule of degree 2, as values of the four shape functions.
_FOUR_POINTS = np.full((4, 4), 0.1381966011250105) + 0.4472135954999579 * np.eye(4)


def _monodomain_equations(
    mesh: Mesh,
    fiber: np.ndarray,
    stretch: np.ndarray,
    time_scale: Callable[[np.ndarray], np.ndarray],
    variant: str,
    recovery: bool = True,
) -> Callable[[float, np.ndarray], np.ndarray]:
    """The equations between the nodes, continuous in time, written a second time with the model's default numbers.

    Of the values [φ, r], shape (2 nodes,), their rates in 1/ms; `variant` is quadrature, nodal or lumped. Dense.
    """
    corners = mesh.points[mesh.cells]
    ones = np.ones((mesh.elements, 4, 1))
    gradients = np.linalg.inv(np.concatenate([ones, corners], axis=2))[:, 1:, :]
    conductivity = np.eye(3) + 0.1 * fiber[:, :, None] * fiber[:, None, :]
    node_rate, points_z = 1.0 / time_scale(mesh.points[:, 2]), corners[:, :, 2] @ _FOUR_POINTS.T
    point_rate = 1.0 / time_scale(points_z.ravel()).reshape(points_z.shape)
    element_mass = 0.25 * mesh.volumes[:, None, None] * (_FOUR_POINTS.T @ _FOUR_POINTS)
    element_stiffness = mesh.volumes[:, None, None] * (gradients.transpose(0, 2, 1) @ conductivity @ gradients)
    opened = 10.0 * np.clip(stretch - 1.0, 0.0, None) * node_rate[mesh.cells].mean(axis=1)

    def assembled(blocks: np.ndarray) -> np.ndarray:
        matrix = np.zeros((mesh.nodes, mesh.nodes))
        np.add.at(matrix, (mesh.cells[:, :, None], mesh.cells[:, None, :]), blocks)
        return matrix

    mass, conductance = assembled(element_mass), assembled(opened[:, None, None] * element_mass)
    if variant == "lumped":
        mass, conductance = np.diag(mass.sum(axis=1)), np.diag(conductance.sum(axis=1))
    source, inverse = 0.6 * conductance.sum(axis=1), np.linalg.inv(mass)
    linear = assembled(element_stiffness) + conductance

    def outward(phi: np.ndarray, r: np.ndarray) -> np.ndarray:
        return 8.0 * phi * (phi - 0.01) * (phi - 1.0) + r * phi

    def rates(_: float, values: np.ndarray) -> np.ndarray:
        phi, r = values.reshape(2, -1)
        if variant == "quadrature":
            current = outward(phi[mesh.cells] @ _FOUR_POINTS.T, r[mesh.cells] @ _FOUR_POINTS.T) * point_rate
            parts = 0.25 * mesh.volumes[:, None] * (current @ _FOUR_POINTS)
            load = np.bincount(mesh.cells.ravel(), parts.ravel(), minlength=mesh.nodes)
        else:
            load = mass @ (outward(phi, r) * node_rate)
        growth = (0.002 + 0.2 * r / (0.3 + phi)) * (-r - 8.0 * phi * (phi - 1.15)) if recovery else np.zeros_like(r)
        return np.concatenate([inverse @ (source - linear @ phi - load), growth * node_rate])

    return rates


@pytest.fixture(scope="session")
def monodomain_equations() -> Callable[..., Callable[[float, np.ndarray], np.ndarray]]:
    """The monodomain equation between the nodes, written a second time, for scipy's integrators."""
    return _monodomain_equations


@pytest.fixture(scope="session")
def box() -> Callable[..., Mesh]:
    """Make a mesh of cut hexahedra with boundaries named by predicates."""
    return _box


@pytest.fixture(scope="session")
def two_chambers() -> Mesh:
    """A box of 35 x 20 x 15 mm with two cavities of 10 x 10 x 10 mm open at Z = 0: LV X in -10..0, RV X in 5..15."""
    return _two_chambers()


@pytest.fixture(scope="session")
def heart() -> Mesh:
    """The shipped baseline mesh."""
    return registry.build("biventricle", 5.0)


@pytest.fixture(scope="session")
def slopes() -> Callable[..., np.ndarray]:
    """Observed orders of convergence between neighbouring sizes."""
    return _slopes


@pytest.fixture(scope="session")
def started() -> Callable[..., Unit]:
    """Take a unit through its start: class, mesh, parameters, inputs by name."""
    return _started


@pytest.fixture(scope="session")
def along() -> Callable[[Mesh, Sequence[float]], np.ndarray]:
    """The same unit vector in every element."""
    return lambda mesh, direction: np.tile(np.asarray(direction, dtype=float), (mesh.elements, 1))
