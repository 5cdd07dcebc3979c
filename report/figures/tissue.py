"""How much tissue there is around each node, and means over it."""

import math

import numpy as np

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body, StoredRun


def shares(run: StoredRun) -> Values:
    """Each node's part of the tissue's volume, area or length, shape (nodes,); they add up to 1."""
    points, cells = run.points_mm, run.cells
    if points is None or cells is None:
        return np.empty(0)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    # Gram's determinant is the square of the content, whatever the dimension.
    content = np.sqrt(np.abs(np.linalg.det(edges @ edges.transpose(0, 2, 1)))) / math.factorial(cells.shape[1] - 1)
    at_nodes = np.bincount(cells.ravel(), np.repeat(content, cells.shape[1]), len(points))
    return np.asarray(at_nodes / at_nodes.sum())


def nodal_mean(mesh: Body, of_elements: Values) -> Values:
    """At each node the mean over the elements around it, by volume, of values of shape (elements, columns)."""
    sums = np.zeros((mesh.nodes, of_elements.shape[1] + 1))
    weighted = mesh.volumes[:, None] * np.column_stack([of_elements, np.ones(mesh.elements)])
    for corner in range(mesh.cells.shape[1]):
        np.add.at(sums, mesh.cells[:, corner], weighted)
    return np.asarray(sums[:, :-1] / sums[:, -1:])
