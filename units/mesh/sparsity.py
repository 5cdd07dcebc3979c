"""Sparse assembly of one unknown a node: element matrices to one CSR matrix, the bookkeeping done once."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from ..arrays import FloatArray, IntArray

SlotArray = NDArray[np.int32]

#: Elements whose matrices are added up at a time: what NumPy needs beside them is bounded.
_BLOCK = 1 << 17


class Pattern:
    """Where the entries of element matrices land in the assembled matrix, whose rows are the nodes.

    `slots`, shape (elements, corners²), tells for each entry of an element's matrix, by rows, which of the assembled
    matrix' `entries` it is added to; `diagonal`, shape (nodes,), which of them are on the diagonal. The assembled
    matrix has the `row_starts` and `columns` of a CSR matrix with sorted columns.

    It is built from the edges, of which there are few against the entries of all element matrices: 1.2 million of a
    million tetrahedra.

    Parameters
    ----------
    cells:
        Node numbers of each element, shape (elements, corners).
    nodes:
        Number of nodes.
    """

    def __init__(self, cells: IntArray, nodes: int) -> None:
        self.size = nodes
        edges = _different_edges(cells, nodes)
        low, high = np.divmod(edges, nodes)
        # The diagonal, the entries above it and those below it, put in order by row and column.
        keys = np.concatenate([np.arange(nodes) * (nodes + 1), edges, high * nodes + low])
        order = np.argsort(keys, kind="stable")
        self.entries = len(keys)
        place = np.empty(self.entries, dtype=np.int32)
        place[order] = np.arange(self.entries, dtype=np.int32)
        self.columns = (keys[order] % nodes).astype(np.int32)
        lengths = 1 + np.bincount(low, minlength=nodes) + np.bincount(high, minlength=nodes)
        self.row_starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        self.diagonal = place[:nodes]
        self.slots = _slots(cells, nodes, edges, place)

    def values(self, element_matrices: FloatArray) -> FloatArray:
        """The entries of the sum of `element_matrices`, shape (elements, corners, corners)."""
        flat = element_matrices.reshape(len(self.slots), -1)
        total = np.zeros(self.entries)
        for begin in range(0, len(flat), _BLOCK):
            part = slice(begin, begin + _BLOCK)
            total += np.bincount(self.slots[part].ravel(), flat[part].ravel(), self.entries)
        return total

    def matrix(self, element_matrices: FloatArray) -> csr_matrix:
        """Sum of `element_matrices`, shape (elements, corners, corners)."""
        return self.csr(self.values(element_matrices))

    def csr(self, values: FloatArray) -> csr_matrix:
        """The matrix of these `values`, shape (entries,)."""
        return csr_matrix((values, self.columns, self.row_starts), shape=(self.size, self.size))


def _keys(cells: IntArray, nodes: int, first: int, second: int) -> IntArray:
    """A number for the edge between two corners of each element, whichever comes first."""
    a, b = cells[:, first], cells[:, second]
    return np.minimum(a, b) * nodes + np.maximum(a, b)


def _different_edges(cells: IntArray, nodes: int) -> IntArray:
    """The numbers of all edges, in order."""
    pairs = list(combinations(range(cells.shape[1]), 2))
    keys = np.empty((len(pairs), len(cells)), dtype=np.int64)
    for row, pair in zip(keys, pairs, strict=True):
        row[:] = _keys(cells, nodes, *pair)
    flat = keys.reshape(-1)
    flat.sort()
    first = np.ones(len(flat), dtype=bool)
    first[1:] = flat[1:] != flat[:-1]
    return flat[first]


def _slots(cells: IntArray, nodes: int, edges: IntArray, place: SlotArray) -> SlotArray:
    corners = cells.shape[1]
    slots = np.empty((len(cells), corners, corners), dtype=np.int32)
    for one in range(corners):
        slots[:, one, one] = place[cells[:, one]]
    for first, second in combinations(range(corners), 2):
        number = nodes + np.searchsorted(edges, _keys(cells, nodes, first, second))
        above, below = place[number], place[number + len(edges)]
        upward = cells[:, first] < cells[:, second]
        slots[:, first, second] = np.where(upward, above, below)
        slots[:, second, first] = np.where(upward, below, above)
    return slots.reshape(len(cells), -1)
