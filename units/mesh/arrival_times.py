"""First arrival times of a wave on simplices: the anisotropic eikonal equation √(∇T · M⁻¹∇T) = 1.

Each node takes the least time over all paths that cross one element from its opposite face, on which T is linear; the
least over a face, an edge or a corner has a closed form (Qian, Zhang & Zhao 2007). The elements at the nodes whose time
has changed are updated at once, until none changes: a band of elements that runs along with the wave. How it fails:
obtuse elements see part of the directions only, so that times are too late by a few per cent on poor meshes; the error
is of first order in the element size.
"""

from itertools import combinations
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..errors import StepFailure
from .simplices import Mesh

#: Relative change of a time that is rounding.
_ROUNDING = 1e-12


def arrival_times(mesh: Mesh, metric: FloatArray, start: FloatArray) -> FloatArray:
    """The times at the nodes, shape (nodes,), in ms.

    Parameters
    ----------
    mesh:
        The mesh; on single points nothing spreads.
    metric:
        M of each element in ms²/mm², shape (elements, 3, 3): a path e takes √(e·M e).
    start:
        Times at which the wave is released, infinite where it is not; shape (nodes,).
    """
    times = np.array(start, dtype=np.float64)
    corners = mesh.dimension + 1
    faces = [
        (node, others)
        for node in range(corners)
        for count in range(1, corners)
        for others in combinations([other for other in range(corners) if other != node], count)
    ]
    inverses = [_inverse_gram(mesh, metric, node, others) for node, others in faces]
    around = _Around(mesh)
    changed = np.flatnonzero(np.isfinite(times))
    # The wave crosses at least one element per sweep.
    for _ in range(mesh.elements + 1):
        active = around(changed)
        if not len(active):
            return times
        before = times.copy()
        cells = mesh.cells[active]
        for (node, others), inverse in zip(faces, inverses, strict=True):
            np.minimum.at(times, cells[:, node], _least(before[cells[:, others]], inverse[active]))
        nodes = np.unique(cells)
        # Infinite times that become finite have changed; what changes by rounding has not.
        changed = nodes[times[nodes] < before[nodes] * (1.0 - _ROUNDING)]
    raise StepFailure("the arrival times did not settle; look for degenerate elements in the mesh")


class _Around:
    """The elements of which some of the given nodes are corners."""

    def __init__(self, mesh: Mesh) -> None:
        corners = mesh.cells.shape[1]
        flat = mesh.cells.ravel()
        self._elements = np.argsort(flat, kind="stable") // corners
        self._counts = np.bincount(flat, minlength=mesh.nodes)
        self._begins = np.cumsum(self._counts) - self._counts

    def __call__(self, nodes: IntArray) -> IntArray:
        counts = self._counts[nodes]
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.unique(self._elements[np.repeat(self._begins[nodes], counts) + within])


def _inverse_gram(mesh: Mesh, metric: FloatArray, node: int, others: tuple[int, ...]) -> FloatArray:
    edges = mesh.points[mesh.cells[:, others]] - mesh.points[mesh.cells[:, node]][:, None]
    return np.linalg.inv(np.einsum("eai,eij,ebj->eab", edges, metric, edges))


def _least(times: FloatArray, inverse: FloatArray) -> FloatArray:
    """The time at the node opposite to a face, infinite where the wave does not come through its inside; (elements,).

    The time t satisfies (t − T)·G⁻¹(t − T) = 1, and comes from the inside where all of G⁻¹(t − T) are positive.
    """
    known: Any = np.isfinite(times).all(axis=1)
    T = np.where(known[:, None], times, 0.0)
    ones = inverse.sum(axis=2)
    a = ones.sum(axis=1)
    b = np.einsum("ea,ea->e", ones, T)
    c = np.einsum("ea,eab,eb->e", T, inverse, T) - 1.0
    discriminant = b * b - a * c
    reached = (b + np.sqrt(np.maximum(discriminant, 0.0))) / a
    weights = np.einsum("eab,eb->ea", inverse, reached[:, None] - T)
    good = known & (discriminant >= 0.0) & np.all(weights >= 0.0, axis=1)
    return np.asarray(np.where(good, reached, np.inf))
