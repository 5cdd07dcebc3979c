"""If these fail, a broken mesh reaches the solvers, which then compute nonsense or die without saying why."""

from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.faces import row_keys
from cardiac_cosim.units.mesh.file import read_mesh, write_mesh
from cardiac_cosim.units.mesh.finite_elements import interpolation
from cardiac_cosim.units.mesh.quality import signed_inverse_condition_number

# Two tetrahedra on either side of the triangle 1, 2, 3.
_POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
_CELLS = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])


def _pair(**boundaries: list[list[int]]) -> Mesh:
    return Mesh(_POINTS, _CELLS, {name: np.array(faces) for name, faces in boundaries.items()})


def test_volumes_centroids_and_surface() -> None:
    mesh = _pair()
    np.testing.assert_allclose(mesh.volumes, [1 / 6, 1 / 3])
    np.testing.assert_allclose(mesh.centroids[0], [0.25, 0.25, 0.25])
    assert (mesh.nodes, mesh.elements, len(mesh.surface)) == (5, 2, 6)
    assert [1, 2, 3] not in np.sort(mesh.surface, axis=1).tolist()


def test_arrays_are_copied_and_cannot_be_changed() -> None:
    points = _POINTS.copy()
    mesh = Mesh(points, _CELLS)
    points[0] = 9.0
    assert mesh.points[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0] = 9.0


@pytest.mark.parametrize("face", [[0, 1, 2], [0, 2, 1], [2, 1, 0]])
def test_boundary_faces_are_turned_outward(face: list[int]) -> None:
    mesh = _pair(floor=[face])
    a, b, c = mesh.points[mesh.boundary("floor")[0]]
    np.testing.assert_allclose(np.cross(b - a, c - a), [0.0, 0.0, -1.0])


def test_baseline_surface_points_outward_everywhere() -> None:
    # Gauss: a closed surface with outward normals encloses the volume of the elements along each axis.
    mesh = registry.build("biventricle", 5.0)
    corners = mesh.points[np.concatenate(list(mesh.boundaries.values()))]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    enclosed = (corners.mean(axis=1) * areas).sum(axis=0)
    np.testing.assert_allclose(enclosed, mesh.volumes.sum(), rtol=1e-10)


def test_boundary_nodes_are_sorted_and_unique() -> None:
    mesh = _pair(floor=[[0, 1, 2]], side=[[0, 1, 3]])
    assert mesh.boundary_nodes("floor", "side").tolist() == [0, 1, 2, 3]


def test_missing_boundary_names_those_there_are() -> None:
    with pytest.raises(InvalidInput, match=r"no boundary named 'base'.*floor"):
        _pair(floor=[[0, 1, 2]]).boundary("base")
    with pytest.raises(InvalidInput, match="it has: none"):
        _pair().boundary_nodes("base")


@pytest.mark.parametrize(
    ("points", "cells", "message"),
    [
        (_POINTS[:, :2], _CELLS, "expected \\(nodes, 3\\)"),
        (_POINTS, _CELLS[:, :3], "has to lie along the first 2 of the axes"),
        (_POINTS, _CELLS[:0], "tetrahedra"),
        (np.where(_POINTS == 0, np.nan, _POINTS), _CELLS, "node 0 .*not finite"),
        (_POINTS, _CELLS + 1, "outside 0..4"),
        (_POINTS, _CELLS - 1, "outside 0..4"),
        (_POINTS, _CELLS[:, [0, 2, 1, 3]], "2 of 2 elements are inverted"),
        (_POINTS * [1, 1, 0], _CELLS, "inverted or flat"),
        (_POINTS, _CELLS[:1], "1 nodes belong to no element, the first is node 4"),
        (np.vstack([_POINTS[:4], _POINTS[:4] + 9]), np.array([[0, 1, 2, 3], [4, 5, 6, 7]]), "falls into 2 pieces"),
        (_POINTS * 1e12, _CELLS, r"node 1 has a coordinate beyond 1e\+09 mm"),
        (_POINTS, np.vstack([_CELLS, _CELLS[:1]]), "1 of 3 elements are listed twice"),
        (_POINTS, np.vstack([_CELLS, _CELLS[:1, [1, 2, 0, 3]]]), "1 of 3 elements are listed twice"),
        # A second top on the same triangle, above it as the first is.
        (
            np.vstack([_POINTS, [[2, 2, 2]]]),
            np.vstack([_CELLS, [[1, 2, 3, 5]]]),
            "overlap: 1 faces are shared by three",
        ),
        (
            np.vstack([_POINTS[:4], [[-1, -1, -1]]]),
            np.array([[0, 1, 2, 3], [4, 1, 2, 3]]),
            "overlap: at 1 faces both elements lie on the same side",
        ),
        # Two tetrahedra that share a node, and an edge.
        (
            np.vstack([_POINTS[:4], -_POINTS[1:4]]),
            np.array([[0, 1, 2, 3], [0, 5, 4, 6]]),
            "2 parts .* by nodes only.* 1 n",
        ),
        (
            np.vstack([_POINTS[:4], [[-1, 0, 0], [0, -1, 0]]]),
            np.array([[0, 1, 2, 3], [0, 4, 5, 3]]),
            "by nodes only.* 2 n",
        ),
    ],
)
def test_unsound_meshes_are_refused(points: np.ndarray, cells: np.ndarray, message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        Mesh(points, cells)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([], "has no face"),
        ([[1, 2, 3]], "not on the surface"),
        ([[0, 1, 4]], "not on the surface"),
        ([[0, 1, 2], [0, 1, 7]], "not on the surface"),
        ([[0, 1, 2], [0, 1, -1]], "not on the surface"),
        ([[0, 1, 2], [2, 0, 1]], "listed twice"),
    ],
)
def test_unsound_boundaries_are_refused(faces: list[list[int]], message: str) -> None:
    with pytest.raises(InvalidInput, match=f"'wrong'.*{message}"):
        _pair(wrong=faces)


def test_rows_of_the_same_numbers_have_the_same_key_however_many_nodes_there_are() -> None:
    rows = np.random.default_rng(3).integers(0, 2**40, (500, 3))
    rows = np.vstack([rows, rows[:, [2, 0, 1]], np.sort(rows, axis=1)])
    for below in (2**40, 2**50):
        keys = row_keys(rows, below).reshape(3, 500)
        assert (keys == keys[0]).all()
        assert len(np.unique(keys)) == 500
        ordered = np.lexsort(np.sort(rows[:500], axis=1).T[::-1])
        np.testing.assert_array_equal(np.argsort(keys[0]), ordered)


# --- files ---------------------------------------------------------------------------------------------------------


def test_round_trip_changes_nothing(tmp_path: Path) -> None:
    mesh = Mesh(_POINTS / 3.0, _CELLS, {"side": np.array([[0, 1, 3]]), "floor": np.array([[0, 1, 2]])})
    path = tmp_path / "new" / "pair.msh"
    write_mesh(mesh, path)
    back = read_mesh(path)
    np.testing.assert_array_equal(back.points, mesh.points)
    np.testing.assert_array_equal(back.cells, mesh.cells)
    assert list(back.boundaries) == ["side", "floor"]
    for name, faces in mesh.boundaries.items():
        np.testing.assert_array_equal(back.boundary(name), faces)


def _refused(path: Path, message: str) -> None:
    with pytest.raises(InvalidInput, match=message) as refusal:
        read_mesh(path)
    assert str(refusal.value).startswith(f"{path}: ")


def test_missing_file(tmp_path: Path) -> None:
    _refused(tmp_path / "none.msh", "no such mesh file")
    _refused(tmp_path, "no such mesh file")


@pytest.mark.parametrize("name", ["wrong.msh", "wrong.vtk", "wrong.xyz", "wrong"])
@pytest.mark.parametrize("content", [b"", b"this is no mesh\n", b"\x00\xff" * 50])
def test_unreadable_file(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    _refused(path, "meshio cannot read it")


def test_truncated_file(tmp_path: Path) -> None:
    path = tmp_path / "pair.msh"
    write_mesh(_pair(floor=[[0, 1, 2]]), path)
    path.write_text(path.read_text()[:300])
    _refused(path, "section \\$Nodes")


def test_file_without_tetrahedra(tmp_path: Path) -> None:
    path = tmp_path / "triangles.msh"
    meshio.write_points_cells(path, _POINTS, [("triangle", _CELLS[:, :3])], file_format="gmsh22")
    _refused(path, "no linear tetrahedra.*triangle")


def test_file_without_named_boundaries(tmp_path: Path) -> None:
    path = tmp_path / "nameless.vtk"
    meshio.write_points_cells(path, _POINTS, [("tetra", _CELLS)])
    _refused(path, "no named boundaries")


def test_file_with_an_unsound_mesh(tmp_path: Path) -> None:
    path = tmp_path / "inverted.msh"
    write_mesh(_pair(floor=[[0, 1, 2]]), path)
    lines = path.read_text().replace(" 1 2 3 4\n", " 2 1 3 4\n")
    path.write_text(lines)
    _refused(path, "inverted")


# --- quality -------------------------------------------------------------------------------------------------------


def test_quality_of_a_regular_tetrahedron_is_one() -> None:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    mesh = Mesh(7.0 * corners, np.array([[0, 2, 1, 3]]))
    np.testing.assert_allclose(signed_inverse_condition_number(mesh), 1.0)


@pytest.mark.parametrize(("pressed_to", "smallest", "largest"), [(1.0, 0.4, 1.0), (0.03, 0.0, 0.2)])
def test_quality_is_gmshs(pressed_to: float, smallest: float, largest: float) -> None:
    # Independent: gmsh's own measure, on well shaped elements and on the same pressed flat.
    heart = registry.build("biventricle", 5.0)
    mesh = Mesh(heart.points * [1.0, 1.0, pressed_to], heart.cells)
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        body = gmsh.model.addDiscreteEntity(3)
        gmsh.model.mesh.addNodes(3, body, np.arange(mesh.nodes) + 1, mesh.points.ravel())
        elements = np.arange(mesh.elements) + 1
        gmsh.model.mesh.addElementsByType(body, 4, elements, mesh.cells.ravel() + 1)
        theirs = gmsh.model.mesh.getElementQualities(elements, "minSICN")
    finally:
        gmsh.finalize()
    ours = signed_inverse_condition_number(mesh)
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    assert smallest < ours.min() < ours.max() < largest


# --- interpolation to the points of a quadrature rule ----------------------------------------------------------------


def test_interpolation_reproduces_linear_functions_at_points_inside_their_elements(heart) -> None:
    to_points, weights = interpolation(heart)
    assert to_points.shape == (len(weights), heart.nodes) == (4 * heart.elements, heart.nodes)
    np.testing.assert_allclose(to_points @ np.ones(heart.nodes), 1.0, rtol=1e-14)
    # The rule of degree 2 by hand: barycentric 0.585…, 0.138… (three times), in whatever order.
    values = np.sort(to_points[[0]].toarray().ravel())[-4:]
    np.testing.assert_allclose(values, [0.1381966011250105] * 3 + [0.5854101966249685], rtol=1e-12)
    places = to_points @ heart.points
    elements = np.repeat(np.arange(heart.elements), 4)
    corners = np.concatenate([heart.points[heart.cells], np.ones((heart.elements, 4, 1))], axis=2)
    inside = np.einsum("ei,eij->ej", np.column_stack([places, np.ones(len(places))]), np.linalg.inv(corners)[elements])
    # Barycentric coordinates of the points in their own elements, found from the places alone.
    np.testing.assert_allclose(np.sort(inside, axis=1), np.tile(values, (len(places), 1)), atol=1e-10)
    linear = 3.0 + heart.points @ [0.5, -2.0, 0.25]
    np.testing.assert_allclose(to_points @ linear, 3.0 + places @ [0.5, -2.0, 0.25], atol=1e-12)


def test_weights_of_interpolation_are_the_volumes(heart) -> None:
    _, weights = interpolation(heart)
    assert (weights > 0.0).all()
    assert weights.sum() == pytest.approx(heart.volumes.sum(), rel=1e-13)
    np.testing.assert_allclose(weights.reshape(heart.elements, 4).sum(axis=1), heart.volumes, rtol=1e-11)


def test_interpolation_integrates_quadratics_exactly(box) -> None:
    mesh = box([0.0, 1.0, 2.5], [0.0, 2.0], [-3.0, -1.0, 0.0])
    to_points, weights = interpolation(mesh)
    x, y, z = (to_points @ mesh.points).T
    for integrand, exact in ((x * x, 2.5**3 / 3 * 6.0), (x * y, 3.125 * 2.0 * 3.0), (y * z, 2.5 * 2.0 * -4.5)):
        assert weights @ integrand == pytest.approx(exact, rel=1e-13)
