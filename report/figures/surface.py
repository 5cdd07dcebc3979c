"""The surface of a body of tetrahedra: faces, normals, edges, and its section by a plane."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from ...orchestrator.participants.participant import Values

Numbers = NDArray[np.int64]

# The faces of a tetrahedron of positive volume, ordered so that their normals point outward.
_FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))

# Faces that meet at less than this angle are parts of one smooth surface.
_SMOOTH = math.cos(math.radians(40.0))


def surface(cells: Numbers) -> tuple[Numbers, Numbers]:
    """Faces of one element only, normals outward, shape (faces, 3), and the element of each, shape (faces,)."""
    faces = cells[:, _FACES].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]], first[count == 1] // 4


def section(points: Values, simplices: Numbers, height: Values) -> tuple[Values, Numbers]:
    """Where `height`, shape (nodes,), is zero in tetrahedra, shape (n, 4), or in triangles, shape (n, 3).

    Returns triangles, shape (m, 3, columns), or lines, shape (m, 2, columns), and the number of the simplex of each.
    `points` has places in mm in its first three columns; what stands in others is interpolated like them.
    """
    size = simplices.shape[1]
    parts, numbers = [np.empty((0, size - 1, points.shape[1]))], [np.empty(0, dtype=np.int64)]
    above = (height[simplices] > 0.0).sum(axis=1)
    for count in range(1, size):
        number = np.flatnonzero(above == count)
        order = np.argsort(-height[simplices[number]], axis=1, kind="stable")
        nodes = np.take_along_axis(simplices[number], order, axis=1)
        start, end = np.repeat(nodes[:, :count], size - count, axis=1), np.tile(nodes[:, count:], count)
        share = (height[start] / (height[start] - height[end]))[..., None]
        crossings = points[start] + share * (points[end] - points[start])
        # Four crossings make two triangles; in this order they share the edge between the second and the third.
        for first in range(crossings.shape[1] - size + 2):
            parts.append(crossings[:, first : first + size - 1])
            numbers.append(number)
    return np.concatenate(parts), np.concatenate(numbers)


def divided(pieces: Values, column: int, levels: Sequence[float]) -> Values:
    """Triangles, shape (n, 3, columns), cut along the lines where `column` has one of the values `levels`."""
    for level in levels:
        above = pieces[..., column] - level
        crossed = (above.min(axis=1) < 0.0) & (above.max(axis=1) > 0.0)
        whole, above = pieces[crossed], above[crossed]
        # One corner is alone on its side; the order of the others stays, and with it the direction of the normal.
        alone = np.where((above > 0.0).sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
        order = (alone[:, None] + np.arange(3)) % 3
        tip, left, right = np.take_along_axis(whole, order[..., None], axis=1).transpose(1, 0, 2)
        height, left_height, right_height = np.take_along_axis(above, order, axis=1).T
        on_left = tip + (height / (height - left_height))[:, None] * (left - tip)
        on_right = tip + (height / (height - right_height))[:, None] * (right - tip)
        parts = [(tip, on_left, on_right), (on_left, left, right), (on_left, right, on_right)]
        pieces = np.concatenate([pieces[~crossed], *(np.stack(part, axis=1) for part in parts)])
    return pieces


def normals(points: Values, faces: Numbers) -> Values:
    """Outward unit normals, shape (faces, 3); zero for a face without area."""
    corners = points[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12))


def smoothing(points: Values, faces: Numbers) -> csr_matrix:
    """Takes values of faces, shape (faces, ...), to their corners, shape (3 faces, ...).

    The value at a corner is the mean over the faces there that continue its own face smoothly: edges stay sharp.
    """
    corners = faces.size
    at_node = coo_matrix((np.ones(corners), (np.arange(corners), faces.ravel()))).tocsr()
    pairs = (at_node @ at_node.T).tocoo()
    normal = normals(points, faces)
    corner, face = pairs.row, pairs.col // 3
    smooth = (np.einsum("ni,ni->n", normal[corner // 3], normal[face]) > _SMOOTH) | (corner // 3 == face)
    corner, face = corner[smooth], face[smooth]
    weights = 1.0 / np.bincount(corner, minlength=corners)[corner]
    return coo_matrix((weights, (corner, face)), shape=(corners, len(faces))).tocsr()


def sharp_edges(points: Values, faces: Numbers) -> Numbers:
    """Nodes at the ends of the edges where a closed surface has a kink, shape (edges, 2)."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    # The surface is closed, so that edges come in pairs.
    order = np.lexsort(edges.T).reshape(-1, 2)
    normal = normals(points, faces)[order // 3]
    return edges[order[np.einsum("ni,ni->n", normal[:, 0], normal[:, 1]) < _SMOOTH, 0]]
