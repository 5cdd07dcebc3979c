"""If these fail, a potential that is read between the nodes is that of another place in the heart."""

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.places import Places
from scipy.optimize import minimize

_SLOPE = np.array([2.0, -3.0, 0.5])

each_dimension = pytest.mark.parametrize("geometry", ["cell", "strand", "sheet", "slab"])


def _linear(points: np.ndarray) -> np.ndarray:
    return np.asarray(points @ _SLOPE + 7.0)


@each_dimension
def test_linear_fields_are_exact_in_every_element(geometry: str) -> None:
    mesh = build(geometry, 5.0)
    shares = np.random.default_rng(3).dirichlet(np.ones(mesh.dimension + 1), mesh.elements)
    points = np.einsum("ev,evi->ei", shares, mesh.points[mesh.cells])
    places = Places(mesh, points)
    np.testing.assert_allclose(places(_linear(mesh.points)), _linear(points), rtol=0, atol=1e-11)
    np.testing.assert_allclose(places.lowest, shares.min(axis=1), atol=1e-12)


@each_dimension
def test_a_point_outside_takes_the_nearest_place(geometry: str) -> None:
    mesh = build(geometry, 5.0)
    lower, upper = mesh.points.min(axis=0), mesh.points.max(axis=0)
    points = np.random.default_rng(5).uniform(lower - 20.0, upper + 20.0, (40, 3))
    # Of a box with its edges along the axes the nearest place is known: every coordinate by itself.
    expected = np.clip(points, lower, upper)
    outside = np.linalg.norm(points - expected, axis=1) > 0.0
    assert outside.sum() > 20
    places = Places(mesh, points)
    found = np.stack([places(mesh.points[:, axis]) for axis in range(3)], axis=1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert (places.lowest[outside] < 0.0).all()


def test_no_place_of_the_heart_is_nearer(two_chambers: Mesh) -> None:
    # In the cavities and around them, where the nearest element by its corners is often not the nearest.
    points = np.random.default_rng(11).uniform([-20.0, -15.0, -20.0], [25.0, 15.0, 5.0], (25, 3))
    places = Places(two_chambers, points)
    found = np.stack([places(two_chambers.points[:, axis]) for axis in range(3)], axis=1)
    corners = two_chambers.points[two_chambers.cells]
    outside = np.flatnonzero(places.lowest < 0.0)
    assert outside.size > 8
    for number in outside[:8]:
        near = np.argsort(np.linalg.norm(corners - points[number], axis=2).min(axis=1))[:60]
        # A minimiser knows nothing of faces and edges.
        best = min(
            minimize(_squared_distance, np.full(3, 0.5), args=(element, points[number]), bounds=[(0.0, 1.0)] * 3).fun
            for element in corners[near]
        )
        assert np.linalg.norm(found[number] - points[number]) == pytest.approx(np.sqrt(best), abs=1e-3)


def _squared_distance(at: np.ndarray, element: np.ndarray, point: np.ndarray) -> float:
    """From `point` to a place in `element`, shape (4, 3), that is given by three numbers in 0..1."""
    a, b, c = at
    weights = np.array([1.0 - a, a * (1.0 - b), a * b * (1.0 - c), a * b * c])
    return float(((weights @ element - point) ** 2).sum())


def test_at_a_node_no_other_node_has_a_say(two_chambers: Mesh) -> None:
    field = np.arange(two_chambers.nodes, dtype=float) ** 2
    np.testing.assert_allclose(Places(two_chambers, two_chambers.points)(field), field, rtol=0, atol=1e-7)


def test_off_the_plane_of_a_mesh_is_outside_however_near() -> None:
    mesh = build("sheet", 5.0)
    middle = mesh.centroids[7]
    on, off = Places(mesh, [middle, middle + np.array([0.0, 0.0, 0.01])]).lowest
    assert on == pytest.approx(1.0 / 3.0)
    assert off == -np.inf


@pytest.mark.parametrize("point", [[0.0, np.nan, 0.0], [np.inf, 0.0, 0.0], [1e200, 0.0, 0.0]])
def test_what_is_nowhere_is_refused(point: list[float], two_chambers: Mesh) -> None:
    with pytest.raises(InvalidInput, match=r"the point \[.*\] lies far outside the mesh"):
        Places(two_chambers, [[0.0, 0.0, -12.0], point])


def test_no_points_are_no_values(two_chambers: Mesh) -> None:
    assert Places(two_chambers, [])(two_chambers.points[:, 0]).shape == (0,)
