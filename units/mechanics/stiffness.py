"""The stiffness of a solid: a symmetric sparse matrix in blocks of 3 × 3, assembled on a pattern that does not change.

Blocks are kept for pairs of nodes (row ≥ column); those on the diagonal are whole. What solvers want of it, the free
degrees of freedom as one triangle or in full, is gathered by index lists that are made once.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix

from ..arrays import FloatArray, IntArray


class StiffnessPattern:
    """Which pairs of nodes have a block, and which entries of the blocks belong to free degrees of freedom.

    Parameters
    ----------
    nodes:
        Node numbers of each element, shape (elements, element nodes).
    free:
        Which degrees of freedom are free, shape (nodes, 3).
    """

    def __init__(self, nodes: IntArray, free: np.ndarray) -> None:
        self._count = len(free)
        self._free = free
        rows, columns = _pairs(nodes)
        self._keys, slots = np.unique(self._key(rows, columns), return_inverse=True)
        #: Slots of all pairs of each element's nodes, shape (elements, pairs).
        self.slots: np.ndarray = self._signed(slots.reshape(rows.shape), rows, columns).astype(np.int32)
        self.blocks = len(self._keys)

    def slots_of(self, nodes: IntArray) -> IntArray:
        """Slots of all pairs (a, b), b ≤ a, of `nodes`, shape (groups, n), which have to be an element's each."""
        rows, columns = _pairs(nodes)
        return self._signed(np.searchsorted(self._keys, self._key(rows, columns)), rows, columns)

    def add(self, blocks: FloatArray, slots: np.ndarray, matrices: FloatArray) -> None:
        """Add symmetric `matrices`, shape (groups, n, 3, n, 3), to `blocks`, shape (blocks, 3, 3), at `slots_of`."""
        corners = matrices.shape[1]
        rows, columns = np.tril_indices(corners)
        parts = matrices.transpose(0, 1, 3, 2, 4)[:, rows, columns]
        above = slots < 0
        place = np.where(above, -1 - slots, slots)
        parts = np.where(above[..., None, None], parts.transpose(0, 1, 3, 2), parts)
        entries = 9 * place.ravel()[:, None] + np.arange(9)
        blocks += np.bincount(entries.ravel(), parts.ravel(), blocks.size).reshape(blocks.shape)

    @cached_property
    def lower(self) -> tuple[IntArray, IntArray, IntArray]:
        """The lower triangle of the free entries by columns: place of each in the blocks, row, starts of columns."""
        place, rows, columns = self._entries
        order = np.lexsort((rows, columns))
        return place[order], rows[order], np.searchsorted(columns[order], np.arange(self.unknowns + 1))

    @cached_property
    def full(self) -> tuple[IntArray, IntArray, IntArray]:
        """All free entries, likewise."""
        place, rows, columns = self._entries
        off = rows != columns
        place = np.concatenate([place, place[off]])
        rows, columns = np.concatenate([rows, columns[off]]), np.concatenate([columns, rows[off]])
        order = np.lexsort((rows, columns))
        return place[order], rows[order], np.searchsorted(columns[order], np.arange(self.unknowns + 1))

    @property
    def unknowns(self) -> int:
        """The free degrees of freedom."""
        return int(np.count_nonzero(self._free))

    @property
    def free(self) -> np.ndarray:
        """Which degrees of freedom are free, shape (nodes, 3)."""
        return self._free

    @property
    def _entries(self) -> tuple[IntArray, IntArray, IntArray]:
        """Place in the blocks, row and column of every free entry with row ≥ column."""
        numbers = np.full(self._count * 3, -1, dtype=np.int32)
        numbers[self._free.ravel()] = np.arange(self.unknowns, dtype=np.int32)
        row, column = self._keys // self._count, self._keys % self._count
        axis = np.arange(3)
        rows = np.broadcast_to(numbers[3 * row[:, None, None] + axis[:, None]], (len(row), 3, 3)).ravel()
        columns = np.broadcast_to(numbers[3 * column[:, None, None] + axis[None, :]], (len(row), 3, 3)).ravel()
        kept = np.flatnonzero((rows >= 0) & (columns >= 0) & (rows >= columns))
        return kept, rows[kept], columns[kept]

    def _key(self, rows: IntArray, columns: IntArray) -> IntArray:
        return np.maximum(rows, columns) * self._count + np.minimum(rows, columns)

    @staticmethod
    def _signed(slots: IntArray, rows: IntArray, columns: IntArray) -> IntArray:
        """Slots whose pair stands above the diagonal, so that its block is kept as its transpose, are −1 − slot."""
        return np.where(rows >= columns, slots, -1 - slots)


@dataclass(frozen=True)
class Stiffness:
    """A matrix on a pattern; `blocks` in N/mm, shape (blocks, 3, 3)."""

    pattern: StiffnessPattern
    blocks: FloatArray

    def lower(self) -> csc_matrix:
        """The lower triangle over the free degrees of freedom, shape (unknowns, unknowns)."""
        return self._gathered(self.pattern.lower)

    def full(self) -> csc_matrix:
        """The whole matrix over the free degrees of freedom, shape (unknowns, unknowns)."""
        return self._gathered(self.pattern.full)

    def _gathered(self, entries: tuple[IntArray, IntArray, IntArray]) -> csc_matrix:
        place, rows, starts = entries
        size = self.pattern.unknowns
        return csc_matrix((self.blocks.ravel()[place], rows, starts), shape=(size, size))


def _pairs(nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Nodes of all pairs (a, b), b ≤ a, of each group, shape (groups, pairs) both."""
    first, second = np.tril_indices(nodes.shape[1])
    return nodes[:, first], nodes[:, second]
