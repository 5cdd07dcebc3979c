"""Nested refinement: every element cut into equal parts, each level halving h."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ..arrays import IntArray
from ..errors import InvalidInput
from .faces import row_keys
from .finite_elements import as_scikit_fem
from .simplices import Mesh

#: Elements that a refined mesh may have, and levels after which nobody counts them any more.
_MOST_ELEMENTS, _MOST_LEVELS = 8_000_000, 25

#: The parts of a face by the mesh's dimension: numbers of its corners, then of the midpoints between each two of them.
_PARTS_OF_FACE = {
    1: ((0,),),
    2: ((0, 2), (2, 1)),
    3: ((0, 3, 4), (3, 1, 5), (4, 5, 2), (3, 5, 4)),
}


@dataclass(frozen=True)
class Refined:
    """A finer mesh, whose first nodes are those of the coarse one, and the coarse element that each element lies in."""

    mesh: Mesh
    parents: IntArray


def refined(mesh: Mesh, levels: int) -> Refined:
    """`mesh` refined `levels` times, its boundaries and notes kept; points and no levels give the mesh itself.

    A boundary's faces are cut where the elements are, two parts of an edge, four of a triangle; the parts of its first
    face come first. All nodes and faces are found by their numbers, none by its place.
    """
    fine, parents = mesh, np.arange(mesh.elements)
    for _ in range(levels if mesh.dimension else 0):
        fine, parents_of_level = _halved(fine)
        parents = parents[parents_of_level]
    return Refined(fine, parents)


def check_levels(mesh: Mesh, levels: int, key: str) -> None:
    """InvalidInput, which names the `key` that asks for them, if `levels` make more elements than a computer holds."""
    elements = mesh.elements * 2 ** (mesh.dimension * min(levels, _MOST_LEVELS))
    if mesh.dimension and levels and (levels > _MOST_LEVELS or elements > _MOST_ELEMENTS):
        raise InvalidInput(
            f"{key} is {levels}, which makes {elements:.3g} elements{' or more' if levels > _MOST_LEVELS else ''} of "
            f"{mesh.elements}; more than {_MOST_ELEMENTS:.0e} are refused: take fewer levels"
        )


def _halved(mesh: Mesh) -> tuple[Mesh, IntArray]:
    coarse = as_scikit_fem(mesh)
    fine = coarse.refined(1)
    points = np.tile(mesh.points[0], (fine.p.shape[1], 1))
    points[:, : mesh.dimension] = fine.p.T
    cells = fine.t.T.copy()
    inverted = np.linalg.det((points[cells[:, 1:]] - points[cells[:, :1]])[:, :, : mesh.dimension]) < 0.0
    cells[inverted, :2] = cells[inverted, 1::-1]
    edges = _edges(coarse, mesh.dimension)
    boundaries = _parts_of_faces(mesh.boundaries, edges, mesh.nodes) if mesh.boundaries else {}
    return Mesh(points, cells, boundaries, mesh.notes), _parents(mesh, edges, cells)


def _edges(mesh: Any, dimension: int) -> IntArray:
    """The edges, shape (edges, 2), in the order in which scikit-fem appends their midpoints to the nodes."""
    return np.asarray({1: mesh.t, 2: mesh.facets, 3: mesh.edges if dimension == 3 else None}[dimension]).T


def _parts_of_faces(boundaries: Mapping[str, IntArray], edges: IntArray, nodes: int) -> dict[str, IntArray]:
    """The parts of each boundary's faces, by corners and midpoints of edges, shape (parts, corners)."""
    corners = np.concatenate(list(boundaries.values()))
    count = corners.shape[1]
    between = list(combinations(range(count), 2))
    midpoints = nodes + _places(corners[:, between].reshape(-1, 2), edges, nodes).reshape(len(corners), len(between))
    parts = np.hstack([corners, midpoints])[:, _PARTS_OF_FACE[count]]
    ends = np.cumsum([len(faces) for faces in boundaries.values()])[:-1]
    return {name: part.reshape(-1, count) for name, part in zip(boundaries, np.split(parts, ends), strict=True)}


def _parents(mesh: Mesh, edges: IntArray, cells: IntArray) -> IntArray:
    """The corners and the edges with whose midpoints a part is made are, together, those of one element."""
    own = np.repeat(np.arange(mesh.nodes)[:, None], 2, axis=1)
    made_of = np.sort(np.vstack([own, edges])[cells].reshape(len(cells), -1), axis=1)
    different = np.ones(made_of.shape, dtype=bool)
    different[:, 1:] = made_of[:, 1:] != made_of[:, :-1]
    return _places(made_of[different].reshape(len(cells), -1), mesh.cells, mesh.nodes)


def _places(rows: IntArray, known: IntArray, nodes: int) -> IntArray:
    """Where in `known` the nodes of each of `rows` stand, in whatever order; shape (rows,)."""
    keys = row_keys(np.concatenate([known, rows]), nodes)
    order = np.argsort(keys[: len(known)])
    return order[np.searchsorted(keys[: len(known)], keys[len(known) :], sorter=order)]
