"""Nested refinement: every element cut into equal parts, each level halving h."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import IntArray
from .faces import row_keys
from .finite_elements import as_scikit_fem
from .simplices import Mesh


@dataclass(frozen=True)
class Refined:
    """A finer mesh, whose first nodes are those of the coarse one, and the coarse element that each element lies in."""

    mesh: Mesh
    parents: IntArray


def refined(mesh: Mesh, levels: int) -> Refined:
    """`mesh` refined `levels` times, without boundaries; points and no levels give the mesh itself."""
    fine, parents = mesh, np.arange(mesh.elements)
    for _ in range(levels if mesh.dimension else 0):
        fine, parents_of_level = _halved(fine)
        parents = parents[parents_of_level]
    return Refined(fine, parents)


def _halved(mesh: Mesh) -> tuple[Mesh, IntArray]:
    coarse = as_scikit_fem(mesh)
    fine = coarse.refined(1)
    points = np.tile(mesh.points[0], (fine.p.shape[1], 1))
    points[:, : mesh.dimension] = fine.p.T
    cells = fine.t.T.copy()
    inverted = np.linalg.det((points[cells[:, 1:]] - points[cells[:, :1]])[:, :, : mesh.dimension]) < 0.0
    cells[inverted, :2] = cells[inverted, 1::-1]
    return Mesh(points, cells), _parents(mesh, _edges(coarse, mesh.dimension), cells)


def _edges(mesh: Any, dimension: int) -> IntArray:
    """The edges, shape (edges, 2), in the order in which scikit-fem appends their midpoints to the nodes."""
    return np.asarray({1: mesh.t, 2: mesh.facets, 3: mesh.edges if dimension == 3 else None}[dimension]).T


def _parents(mesh: Mesh, edges: IntArray, cells: IntArray) -> IntArray:
    """The corners and the edges with whose midpoints a part is made are, together, those of one element."""
    own = np.repeat(np.arange(mesh.nodes)[:, None], 2, axis=1)
    made_of = np.sort(np.vstack([own, edges])[cells].reshape(len(cells), -1), axis=1)
    different = np.ones(made_of.shape, dtype=bool)
    different[:, 1:] = made_of[:, 1:] != made_of[:, :-1]
    corners = made_of[different].reshape(len(cells), -1)
    keys = row_keys(np.concatenate([mesh.cells, corners]), mesh.nodes)
    order = np.argsort(keys[: mesh.elements])
    return order[np.searchsorted(keys[: mesh.elements], keys[mesh.elements :], sorter=order)]
