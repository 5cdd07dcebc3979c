"""Sparse assembly on a fixed pattern: element matrices to one CSR matrix, the bookkeeping done once."""

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import FloatArray, IntArray


class Pattern:
    """Where the entries of element matrices land in the assembled matrix.

    Parameters
    ----------
    dofs:
        Degrees of freedom of each element, shape (elements, dofs per element); negative ones are left out.
    size:
        Number of degrees of freedom.
    """

    def __init__(self, dofs: IntArray, size: int) -> None:
        per_element = dofs.shape[1]
        rows = np.repeat(dofs, per_element, axis=1).ravel()
        columns = np.tile(dofs, (1, per_element)).ravel()
        kept = (rows >= 0) & (columns >= 0)
        place, slot = np.unique(rows[kept] * size + columns[kept], return_inverse=True)
        # Entries left out are summed into one slot past the end, so that no mask is needed at assembly.
        self._slot = np.full(len(rows), len(place))
        self._slot[kept] = slot
        self._entries = len(place)
        self._columns = (place % size).astype(np.int32)
        self._row_starts = np.searchsorted(place, np.arange(size + 1) * size).astype(np.int32)
        self._shape = (size, size)

    def matrix(self, element_matrices: FloatArray) -> csr_matrix:
        """Sum of `element_matrices`, shape (elements, dofs per element, dofs per element)."""
        data = np.bincount(self._slot, element_matrices.ravel(), self._entries + 1)[:-1]
        return csr_matrix((data, self._columns, self._row_starts), shape=self._shape)
