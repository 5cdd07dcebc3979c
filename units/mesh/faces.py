"""The faces of simplices, counted: which bound the mesh, and where elements do not meet properly."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..arrays import IntArray

#: The faces of a simplex by its dimension; of a tetrahedron each is ordered so that its normal points out of an element
#: of positive volume.
_FACES = {
    0: (),
    1: ((1,), (0,)),
    2: ((1, 2), (2, 0), (0, 1)),
    3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
}


def row_keys(rows: IntArray, below: int) -> IntArray:
    """A number for each row of numbers from 0 to `below` − 1, whatever their order, shape (rows,).

    Equal for rows that hold the same numbers, and in their lexicographic order; keys of two calls cannot be compared.
    Three node numbers of a mesh of up to two million nodes fit into 63 bits; with more, what came first is numbered
    anew.
    """
    ordered = np.sort(rows, axis=1)
    keys, largest = np.zeros(len(rows), dtype=np.int64), 1
    for column in ordered.T:
        if largest > np.iinfo(np.int64).max // below:
            different, keys = np.unique(keys, return_inverse=True)
            largest = len(different)
        keys = keys * below + column
        largest *= below
    return keys


def repeated(keys: IntArray) -> int:
    """How many of `keys` are there more than once, the first of each not counted."""
    return int(np.count_nonzero(np.diff(np.sort(keys)) == 0))


@dataclass(frozen=True)
class Faces:
    """All faces of all elements, and how they meet.

    Parameters
    ----------
    surface:
        Faces that belong to one element only, normals outward, in the order of their keys, shape (faces, dimension).
    crowded:
        How many places are a face of more than two elements.
    folded:
        How many faces two elements share that lie on the same side of it, so that they overlap.
    parts:
        For each element the number of the part it belongs to, elements that share a face being of one part.
    """

    surface: IntArray
    crowded: int
    folded: int
    parts: IntArray


def faces_of(cells: IntArray, nodes: int) -> Faces:
    """The faces of `cells`, shape (elements, dimension + 1), with node numbers below `nodes`."""
    elements, dimension = len(cells), cells.shape[1] - 1
    if dimension == 0:
        return Faces(np.empty((0, 0), dtype=np.int64), 0, 0, np.arange(elements))
    faces = cells[:, _FACES[dimension]].reshape(-1, dimension)
    keys = row_keys(faces, nodes)
    order = np.argsort(keys, kind="stable")
    begins = np.flatnonzero(np.diff(keys[order], prepend=-1))
    count = np.diff(begins, append=len(order))
    one, other = order[begins[count == 2]], order[begins[count == 2] + 1]
    turned = _turned(faces)
    folded = int(np.count_nonzero(turned[one] == turned[other]))
    neighbours = one // (dimension + 1), other // (dimension + 1)
    graph = coo_matrix((np.ones(len(one), dtype=np.int8), neighbours), shape=(elements, elements))
    _, parts = connected_components(graph, directed=False)
    return Faces(faces[order[begins[count == 1]]], int(np.count_nonzero(count > 2)), folded, parts)


def _turned(faces: IntArray) -> np.ndarray:
    """Which of two ways round each face is written; of the ends of lines, which end it is."""
    if faces.shape[1] == 1:
        return np.arange(len(faces)) % 2 == 0
    odd = np.zeros(len(faces), dtype=bool)
    for first in range(faces.shape[1]):
        for second in range(first + 1, faces.shape[1]):
            odd ^= faces[:, first] > faces[:, second]
    return odd
