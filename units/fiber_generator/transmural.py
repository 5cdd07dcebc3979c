"""The direction through the wall and the place in it: a Laplace problem and two wall distances."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree
from skfem import BilinearForm, condense
from skfem.helpers import dot, grad

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..mesh import Mesh
from ..mesh.finite_elements import linear_basis, shape_gradients

#: Gradient of the wall coordinate, relative to the largest, below which an element counts as having none.
_FLAT = 1e-10


@BilinearForm
def _laplace(u, v, w):  # type: ignore[no-untyped-def]
    return dot(grad(u), grad(v))


def transmural_direction(mesh: Mesh, endocardium: tuple[str, ...], epicardium: tuple[str, ...]) -> FloatArray:
    """s₀ = −∇w/|∇w| per element, shape (elements, 3); w is harmonic, 1 on the endocardium, 0 on the epicardium.

    A node on both counts as epicardial. Elements without a gradient (all their nodes on one surface) take the mean
    of their neighbours (model.md, Fibre generator, 1). Raises InvalidInput if some have no neighbour that
    has one.
    """
    w = np.zeros(mesh.nodes)
    inner, outer = mesh.boundary_nodes(*endocardium), mesh.boundary_nodes(*epicardium)
    w[inner] = 1.0
    w[outer] = 0.0
    laplace = _laplace.assemble(linear_basis(mesh))
    system, right, _, free = condense(laplace, x=w, D=np.union1d(inner, outer))
    if len(free):
        w[free] = spsolve(system.tocsc(), right)
    gradient = np.einsum("ea,eai->ei", w[mesh.cells], shape_gradients(mesh))
    gradient = _filled_from_neighbours(mesh, gradient)
    return np.asarray(-gradient / np.linalg.norm(gradient, axis=1, keepdims=True))


def _filled_from_neighbours(mesh: Mesh, gradient: FloatArray) -> FloatArray:
    """`gradient` with the mean of the neighbours' where it vanishes, a neighbour counted per node it shares.

    The mean is of gradients, not of directions: a steep neighbour, one that spans the wall, says more about the way
    through it than a nearly flat one.
    """
    threshold = _FLAT * np.linalg.norm(gradient, axis=1).max()
    flat = np.linalg.norm(gradient, axis=1) <= threshold
    elements = np.repeat(np.arange(mesh.elements), mesh.cells.shape[1])
    has_node = coo_matrix((np.ones(len(elements)), (elements, mesh.cells.ravel()))).tocsr()
    while flat.any():
        filled = has_node[flat] @ (has_node.T @ gradient)
        found = np.linalg.norm(filled, axis=1) > threshold
        if not found.any():
            raise InvalidInput(
                f"{flat.sum()} elements have no direction through the wall, nor has a neighbour; "
                "refine the mesh so that the wall has inner nodes"
            )
        where = np.flatnonzero(flat)[found]
        gradient[where] = filled[found]
        flat[where] = False
    return gradient


def wall_distance(points: FloatArray, mesh: Mesh, boundaries: tuple[str, ...]) -> FloatArray:
    """Distance in mm of `points`, shape (points, 3), to the nearest place on the faces of `boundaries`.

    Exact for the facetted surface. Candidates come from a tree of face centres: a face can only be nearest if its
    centre is no farther than the nearest face corner plus its own radius.
    """
    faces = np.concatenate([mesh.boundary(name) for name in boundaries])
    corners = mesh.points[faces]
    centres = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centres[:, None], axis=2).max()
    bound, _ = cKDTree(mesh.points[np.unique(faces)]).query(points)
    candidates = cKDTree(centres).query_ball_point(points, bound + radius)
    counts = np.fromiter(map(len, candidates), dtype=np.int64, count=len(points))
    which = np.repeat(np.arange(len(points)), counts)
    face = np.concatenate([np.asarray(found, dtype=np.int64) for found in candidates])
    distance = np.full(len(points), np.inf)
    np.minimum.at(distance, which, _distance_to_triangles(points[which], corners[face]))
    return distance


def _distance_to_triangles(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance of point i to triangle i: to its plane where the foot lies inside, else to the nearest edge."""
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    area = np.einsum("ij,ij->i", normal, normal)
    inside = np.ones(len(points), dtype=bool)
    to_edge = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, offset = end - start, points - start
        along = np.clip(np.einsum("ij,ij->i", offset, edge) / np.einsum("ij,ij->i", edge, edge), 0.0, 1.0)
        to_edge = np.minimum(to_edge, np.linalg.norm(offset - along[:, None] * edge, axis=1))
        inside &= np.einsum("ij,ij->i", np.cross(edge, offset), normal) >= 0.0
    to_plane = np.abs(np.einsum("ij,ij->i", points - a, normal)) / np.sqrt(area)
    return np.asarray(np.where(inside, to_plane, to_edge))
