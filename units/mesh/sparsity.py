"""Sparse assembly on a fixed pattern: element matrices to one CSR matrix, the bookkeeping done once."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from ..arrays import FloatArray, IntArray

SlotArray = NDArray[np.int32]

#: Elements whose matrices are added up at a time: what NumPy needs beside them is bounded.
_BLOCK = 1 << 17


class Pattern:
    """Where the entries of element matrices land in the assembled matrix.

    `slots`, shape (elements, dofs per element squared), tells for each entry of an element's matrix, by rows, which of
    the assembled matrix' `entries` it is added to; entries of degrees of freedom that are left out have the slot
    `entries`. The assembled matrix has the `row_starts` and `columns` of a CSR matrix with sorted columns.

    It is built from the different pairs of degrees of freedom, of which a mesh has few against the entries of its
    element matrices: a million tetrahedra have 1.2 million edges.

    Parameters
    ----------
    dofs:
        Degrees of freedom of each element, shape (elements, dofs per element); negative ones are left out. Each
        degree of freedom belongs to an element.
    size:
        Number of degrees of freedom.
    """

    def __init__(self, dofs: IntArray, size: int) -> None:
        self.size = size
        pairs = _different_pairs(dofs, size)
        low, high = np.divmod(pairs, size)
        # The rows of the diagonal, of the entries above it and of those below it, put in order by row and column.
        diagonal = np.arange(size)
        keys = np.concatenate([diagonal * (size + 1), pairs, high * size + low])
        order = np.argsort(keys, kind="stable")
        self.entries = len(keys)
        place = np.empty(self.entries, dtype=np.int32)
        place[order] = np.arange(self.entries, dtype=np.int32)
        self.columns = (keys[order] % size).astype(np.int32)
        lengths = 1 + np.bincount(low, minlength=size) + np.bincount(high, minlength=size)
        self.row_starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        self.slots = _slots(dofs, size, pairs, place, self.entries)
        #: The entries of the diagonal, shape (size,).
        self.diagonal = place[:size]

    def values(self, element_matrices: FloatArray) -> FloatArray:
        """The entries of the sum of `element_matrices`, shape (elements, dofs per element, dofs per element)."""
        flat = element_matrices.reshape(len(self.slots), -1)
        total = np.zeros(self.entries + 1)
        for begin in range(0, len(flat), _BLOCK):
            part = slice(begin, begin + _BLOCK)
            total += np.bincount(self.slots[part].ravel(), flat[part].ravel(), self.entries + 1)
        return total[:-1]

    def matrix(self, element_matrices: FloatArray) -> csr_matrix:
        """Sum of `element_matrices`, shape (elements, dofs per element, dofs per element)."""
        return self.csr(self.values(element_matrices))

    def csr(self, values: FloatArray) -> csr_matrix:
        """The matrix of these `values`, shape (entries,)."""
        return csr_matrix((values, self.columns, self.row_starts), shape=(self.size, self.size))


def _keys(dofs: IntArray, size: int, first: int, second: int) -> IntArray:
    """A number for the pair of an element's degrees of freedom, whichever comes first; −1 where one is left out."""
    a, b = dofs[:, first], dofs[:, second]
    return np.where((a < 0) | (b < 0), -1, np.minimum(a, b) * size + np.maximum(a, b))


def _different_pairs(dofs: IntArray, size: int) -> IntArray:
    """The keys of all pairs of different degrees of freedom that some element has, in order."""
    per_element = dofs.shape[1]
    pairs = list(combinations(range(per_element), 2))
    keys = np.empty((len(pairs), len(dofs)), dtype=np.int64)
    for row, pair in zip(keys, pairs, strict=True):
        row[:] = _keys(dofs, size, *pair)
    flat = keys.reshape(-1)
    flat.sort()
    first = np.ones(len(flat), dtype=bool)
    first[1:] = flat[1:] != flat[:-1]
    different = flat[first]
    return different[different >= 0]


def _slots(dofs: IntArray, size: int, pairs: IntArray, place: SlotArray, left_out: int) -> SlotArray:
    per_element = dofs.shape[1]
    slots = np.full((len(dofs), per_element, per_element), left_out, dtype=np.int32)
    for one in range(per_element):
        kept = dofs[:, one] >= 0
        slots[kept, one, one] = place[dofs[kept, one]]
    for first, second in combinations(range(per_element), 2):
        keys = _keys(dofs, size, first, second)
        kept = keys >= 0
        number = size + np.searchsorted(pairs, keys[kept])
        above, below = place[number], place[number + len(pairs)]
        upward = dofs[kept, first] < dofs[kept, second]
        slots[kept, first, second] = np.where(upward, above, below)
        slots[kept, second, first] = np.where(upward, below, above)
    return slots.reshape(len(dofs), -1)
