"""Averages of element values around each node, computed in one way for all units, so that they agree."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ..arrays import FloatArray, IntArray


def around_nodes(cells: IntArray, volumes: FloatArray) -> csr_matrix:
    """The average by volume over the elements around a node, shape (nodes, elements).

    `cells` are the elements' vertices, shape (elements, vertices), `volumes` their volumes, shape (elements,).
    """
    nodes = cells.ravel()
    elements = np.repeat(np.arange(len(cells)), cells.shape[1])
    weights = coo_matrix((volumes[elements], (nodes, elements))).tocsr()
    return weights.multiply(1.0 / weights.sum(axis=1)).tocsr()
