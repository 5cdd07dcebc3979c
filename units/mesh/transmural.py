"""The direction through the wall and the place in it: a Laplace problem and two wall distances."""

from itertools import chain

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray
from ..conjugate_gradients import conjugate_gradients
from ..errors import InvalidInput
from .finite_elements import diffusion_matrices, shape_gradients
from .simplices import Mesh
from .sparsity import Pattern

#: Gradient of the wall coordinate, relative to the largest, below which an element counts as having none.
_FLAT = 1e-10

#: Points whose wall distance is sought at a time, which bounds the memory, and faces that are looked at first.
_BLOCK, _NEAREST = 1 << 13, 4


#: Residual to which w is solved, relative to the right-hand side; what conjugate gradients do not reach in so many
#: iterations, on slivers, is factorised.
_TOLERANCE, _ITERATIONS = 1e-13, 2000


def transmural_direction(mesh: Mesh, endocardium: tuple[str, ...], epicardium: tuple[str, ...]) -> FloatArray:
    """s₀ = −∇w/|∇w| per element, shape (elements, 3); w is harmonic, 1 on the endocardium, 0 on the epicardium.

    A node on both counts as epicardial. Elements without a gradient (all their nodes on one surface) take the mean
    of their neighbours (docs/model.md, Fibre generator, 1). Raises InvalidInput if some have no neighbour that
    has one.
    """
    w = np.zeros(mesh.nodes)
    inner, outer = mesh.boundary_nodes(*endocardium), mesh.boundary_nodes(*epicardium)
    w[inner] = 1.0
    w[outer] = 0.0
    free = np.setdiff1d(np.arange(mesh.nodes), np.union1d(inner, outer))
    if len(free):
        laplace = Pattern(mesh.cells, mesh.nodes).matrix(
            diffusion_matrices(mesh, np.broadcast_to(np.eye(3), (1, 3, 3)))
        )
        w[free] = _solved(laplace[free][:, free], -(laplace @ w)[free])
    gradient = np.einsum("ea,eai->ei", w[mesh.cells], shape_gradients(mesh))
    gradient = _filled_from_neighbours(mesh, gradient)
    return np.asarray(-gradient / np.linalg.norm(gradient, axis=1, keepdims=True))


def _solved(system: csr_matrix, right: FloatArray) -> FloatArray:
    """Both sides of the wall hold w: iterations grow with the elements across it only, a factor's memory with all."""
    solution = conjugate_gradients(system, right, np.zeros_like(right), _TOLERANCE, _ITERATIONS)
    return np.asarray(spsolve(system.tocsc(), right)) if solution is None else solution


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
                f"{flat.sum()} elements have no direction through the wall, and neither has any of their neighbours; "
                "refine the mesh so that the wall has inner nodes"
            )
        where = np.flatnonzero(flat)[found]
        gradient[where] = filled[found]
        flat[where] = False
    return gradient


def wall_distance(points: FloatArray, mesh: Mesh, boundaries: tuple[str, ...]) -> FloatArray:
    """Distance in mm of `points`, shape (points, 3), to the nearest place on the faces of `boundaries`.

    Exact for the facetted surface. Candidates come from a tree of face centres: a face can only be nearest if its
    centre is no farther than what the nearest centres' faces gave already, plus its own radius.
    """
    faces = np.concatenate([mesh.boundary(name) for name in boundaries])
    corners = mesh.points[faces]
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    tree, distance = cKDTree(centres), np.full(len(points), np.inf)
    for begin in range(0, len(points), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        near = tree.query(points[part], k=np.arange(1, min(_NEAREST, len(faces)) + 1))[1]
        distance[part] = _least_distance(points[part], corners, near.ravel(), np.full(len(near), near.shape[1]))
        within = tree.query_ball_point(points[part], distance[part] + radii.max(), return_sorted=False)
        counts = np.fromiter(map(len, within), dtype=np.int64, count=len(within))
        face = np.fromiter(chain.from_iterable(within), dtype=np.int64, count=counts.sum())
        which = np.repeat(np.arange(len(counts)), counts)
        away = np.linalg.norm(points[part][which] - centres[face], axis=1)
        nearer = away <= distance[part][which] + radii[face]
        counts = np.bincount(which[nearer], minlength=len(counts))
        distance[part] = np.minimum(distance[part], _least_distance(points[part], corners, face[nearer], counts))
    return distance


def _least_distance(points: FloatArray, corners: FloatArray, face: IntArray, counts: IntArray) -> FloatArray:
    """The least distance of each point to its candidates, `counts` of them each, one after the other in `face`."""
    distances = _distance_to_triangles(np.repeat(points, counts, axis=0), corners[face])
    least = np.full(len(points), np.inf)
    some = counts > 0
    least[some] = np.minimum.reduceat(distances, (np.cumsum(counts) - counts)[some])
    return least


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
