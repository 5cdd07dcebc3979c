"""The mesh that all units of a scene share: points, lines, triangles or tetrahedra with named boundaries."""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..arrays import FloatArray, IntArray
from ..errors import InvalidInput

#: The faces of a simplex by its dimension; of a tetrahedron each is ordered so that its normal points out of an element
#: of positive volume.
_FACES = {
    0: (),
    1: ((1,), (0,)),
    2: ((1, 2), (2, 0), (0, 1)),
    3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
}
_KINDS = {0: "points", 1: "lines", 2: "triangles", 3: "tetrahedra"}


@dataclass(frozen=True, eq=False)
class Mesh:
    """Simplices of one dimension in the undeformed configuration (model.md, Geometry).

    A scene has as many dimensions as it needs: tetrahedra in space, triangles in the x-y plane, lines along x, or
    single points, which are elements and nodes at once.

    Parameters
    ----------
    points:
        Node coordinates in mm, shape (nodes, 3).
    cells:
        Node numbers of each element, shape (elements, dimension + 1), of positive volume.
    boundaries:
        For each boundary name the node numbers of its faces, shape (faces, dimension). The order within a face is
        free: faces of tetrahedra are turned so that their normal points out of the tissue.

    Raises
    ------
    InvalidInput
        For coordinates that are not finite, node numbers out of range, inverted or flat elements, nodes without an
        element, elements that hang together in several pieces, and boundary faces that are not on the surface.
    """

    points: FloatArray
    cells: IntArray
    boundaries: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64)
        cells = np.array(self.cells, dtype=np.int64)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cells", cells)
        self._check_cells()
        boundaries = {name: self._outward(name, faces) for name, faces in self.boundaries.items()}
        object.__setattr__(self, "boundaries", boundaries)
        for array in (points, cells, *boundaries.values()):
            array.setflags(write=False)

    @property
    def dimension(self) -> int:
        """0 for points to 3 for tetrahedra."""
        return int(self.cells.shape[1]) - 1

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.cells)

    @cached_property
    def fingerprint(self) -> str:
        """A hash of coordinates, elements and boundaries."""
        digest = hashlib.sha256()
        for name, array in (("points", self.points), ("cells", self.cells), *sorted(self.boundaries.items())):
            digest.update(name.encode() + array.tobytes())
        return digest.hexdigest()

    @cached_property
    def volumes(self) -> FloatArray:
        """Volumes in mm³ of tetrahedra, areas of triangles, lengths of lines; 1 for points; shape (elements,)."""
        edges = self.points[self.cells[:, 1:]] - self.points[self.cells[:, :1]]
        return np.asarray(np.linalg.det(edges[:, :, : self.dimension]) / math.factorial(self.dimension))

    @cached_property
    def centroids(self) -> FloatArray:
        """Element centroids in mm, shape (elements, 3)."""
        return np.asarray(self.points[self.cells].mean(axis=1))

    @cached_property
    def surface(self) -> IntArray:
        """All faces that belong to one element only, those of tetrahedra with normals outward, (faces, dimension)."""
        if self.dimension == 0:
            return np.empty((0, 0), dtype=np.int64)
        faces = self.cells[:, _FACES[self.dimension]].reshape(-1, self.dimension)
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        return np.asarray(faces[first[count == 1]])

    def boundary(self, name: str) -> IntArray:
        """Faces of the boundary `name`, shape (faces, 3), normals outward; InvalidInput if the mesh has none."""
        if name not in self.boundaries:
            have = ", ".join(sorted(self.boundaries)) or "none"
            raise InvalidInput(
                f"the mesh has no boundary named '{name}' (it has: {have}); "
                f"name that part of the surface by a physical group '{name}'"
            )
        return self.boundaries[name]

    def boundary_nodes(self, *names: str) -> IntArray:
        """Sorted numbers of the nodes on any of the boundaries `names`."""
        return np.unique(np.concatenate([self.boundary(name).ravel() for name in names]))

    def _check_cells(self) -> None:
        points, cells = self.points, self.cells
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise InvalidInput(f"mesh points have the shape {points.shape}, expected (nodes, 3)")
        if cells.ndim != 2 or cells.shape[1] - 1 not in _KINDS or not len(cells):
            raise InvalidInput(
                f"mesh elements have the shape {cells.shape}, expected (elements, 1 to 4): points, lines, triangles "
                "or tetrahedra"
            )
        if not np.isfinite(points).all():
            raise InvalidInput(f"node {_first(~np.isfinite(points).all(axis=1))} has a coordinate that is not finite")
        if cells.min() < 0 or cells.max() >= len(points):
            raise InvalidInput(f"an element names a node outside 0..{len(points) - 1}")
        flat = points[:, self.dimension :]
        if self.dimension and flat.size and np.ptp(flat, axis=0).max() > 0.0:
            raise InvalidInput(
                f"a mesh of {_KINDS[self.dimension]} has to lie along the first {self.dimension} of the axes x, y, z; "
                "turn it, or mesh a volume"
            )
        inverted = self.volumes <= 0.0
        if inverted.any():
            where = _first(inverted)
            raise InvalidInput(
                f"{inverted.sum()} of {len(cells)} elements are inverted or flat, the first is element {where} "
                f"(volume {self.volumes[where]:.3g} mm³, near {np.round(self.centroids[where], 2).tolist()} mm); "
                "reorder its nodes or mesh that place anew"
            )
        unused = np.ones(len(points), dtype=bool)
        unused[cells] = False
        if unused.any():
            raise InvalidInput(
                f"{unused.sum()} nodes belong to no element, the first is node {_first(unused)}; "
                "save the mesh without them (in gmsh: physical groups for the volume and its boundaries only)"
            )
        if self.dimension == 0:
            # Points are cells that do not know of each other.
            return
        first = np.repeat(cells[:, 0], self.dimension)
        graph = coo_matrix((np.ones(len(first)), (first, cells[:, 1:].ravel())), shape=(len(points),) * 2)
        pieces, piece = connected_components(graph, directed=False)
        if pieces > 1:
            smallest = np.bincount(piece).argmin()
            where = _first(piece == smallest)
            raise InvalidInput(
                f"the mesh falls into {pieces} pieces that share no node; the smallest holds node {where} at "
                f"{np.round(points[where], 2).tolist()} mm. Remove it or fuse the volumes before meshing"
            )

    def _outward(self, name: str, faces: IntArray) -> IntArray:
        faces = np.array(faces, dtype=np.int64).reshape(-1, max(self.dimension, 1))
        if not len(faces):
            raise InvalidInput(f"the boundary '{name}' has no face")
        oriented = {tuple(sorted(face)): face for face in self.surface.tolist()}
        try:
            return np.array([oriented[tuple(sorted(face))] for face in faces.tolist()], dtype=np.int64)
        except KeyError as missing:
            raise InvalidInput(
                f"the boundary '{name}' has a face {missing.args[0]} that is not on the surface of the mesh"
            ) from None


def _first(mask: Any) -> int:
    return int(np.flatnonzero(mask)[0])
