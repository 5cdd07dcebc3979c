"""The mesh that all units of a scene share: points, lines, triangles or tetrahedra with named boundaries."""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..errors import InvalidInput, listed
from .faces import Faces, faces_of, repeated, row_keys

#: A coordinate that nothing can be computed with: a thousand kilometres, in mm.
_FARTHEST_MM = 1e9
_KINDS = {0: "points", 1: "lines", 2: "triangles", 3: "tetrahedra"}


@dataclass(frozen=True, eq=False)
class Mesh:
    """Simplices of one dimension in the undeformed configuration (docs/model.md, Geometry).

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
    notes:
        What was changed or left out to make this mesh of a file, in sentences for a person.

    Raises
    ------
    InvalidInput
        For coordinates that are not finite or beyond reason, node numbers out of range, inverted or flat elements,
        elements listed twice or overlapping, nodes without an element, elements that do not hang together by their
        faces, and boundary faces that are not on the surface or listed twice.
    """

    points: FloatArray
    cells: IntArray
    boundaries: Mapping[str, IntArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64)
        cells = np.array(self.cells, dtype=np.int64)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cells", cells)
        faces = self._checked_faces()
        # What the check found is what the cached property would find again.
        self.__dict__["surface"] = faces.surface
        boundaries = self._outward(faces.surface) if self.boundaries else {}
        object.__setattr__(self, "boundaries", boundaries)
        for array in (points, cells, faces.surface, *boundaries.values()):
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
        return faces_of(self.cells, self.nodes).surface

    def boundary(self, name: str) -> IntArray:
        """Faces of the boundary `name`, shape (faces, 3), normals outward; InvalidInput if the mesh has none."""
        if name not in self.boundaries:
            raise InvalidInput(
                f"the mesh has no boundary named '{name}' (it has: {listed(self.boundaries)}); "
                f"name that part of the surface by a physical group '{name}', or say which groups of the file it is by "
                "scene.boundaries"
            )
        return self.boundaries[name]

    def boundary_nodes(self, *names: str) -> IntArray:
        """Sorted numbers of the nodes on any of the boundaries `names`."""
        return np.unique(np.concatenate([self.boundary(name).ravel() for name in names]))

    def _checked_faces(self) -> Faces:
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
        if np.abs(points).max() > _FARTHEST_MM:
            far = _first(np.abs(points).max(axis=1) > _FARTHEST_MM)
            raise InvalidInput(
                f"node {far} has a coordinate beyond {_FARTHEST_MM:g} mm, {points[far].tolist()}; correct it"
            )
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
                "reorder its nodes or mesh that place again"
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
            return faces_of(cells, len(points))
        twice = repeated(row_keys(cells, len(points)))
        if twice:
            raise InvalidInput(f"{twice} of {len(cells)} elements are listed twice; list each once")
        faces = faces_of(cells, len(points))
        if faces.crowded or faces.folded:
            what = (
                f"{faces.crowded} faces are shared by three elements or more"
                if faces.crowded
                else f"at {faces.folded} faces both elements lie on the same side"
            )
            raise InvalidInput(
                f"elements overlap: {what}; mesh volumes that overlap as one (in gmsh: fuse or fragment them first)"
            )
        self._check_parts(faces.parts)
        return faces

    def _check_parts(self, part: IntArray) -> None:
        """All elements hang together by faces; what shares single nodes or edges only is held by nothing."""
        sizes = np.bincount(part)
        if len(sizes) == 1:
            return
        element = _first(part == sizes.argmin())
        where = f"near {np.round(self.centroids[element], 2).tolist()} mm"
        nodes = np.unique(self.cells[part == part[element]])
        shared = np.intersect1d(nodes, self.cells[part != part[element]])
        if len(shared):
            raise InvalidInput(
                f"the mesh falls into {len(sizes)} parts that are connected by nodes only; the smallest, of "
                f"{sizes.min()} elements {where}, shares {len(shared)} nodes with the others, but no face. "
                "Remove it or fuse the volumes before meshing"
            )
        raise InvalidInput(
            f"the mesh falls into {len(sizes)} pieces that share no node; the smallest has {sizes.min()} elements "
            f"{where}. Remove it or fuse the volumes before meshing"
        )

    def _outward(self, surface: IntArray) -> dict[str, IntArray]:
        """The boundaries' faces as the surface has them, in their own order."""
        shape = (-1, max(self.dimension, 1))
        given = {name: np.array(faces, dtype=np.int64).reshape(shape) for name, faces in self.boundaries.items()}
        every = np.concatenate([surface.reshape(shape), *given.values()])
        outside = np.asarray(((every < 0) | (every >= self.nodes)).any(axis=1))
        keys = row_keys(np.where(outside[:, None], 0, every), self.nodes)
        known, end, outward = keys[: len(surface)], len(surface), {}
        for name, faces in given.items():
            if not len(faces):
                raise InvalidInput(f"the boundary '{name}' has no face")
            begin, end = end, end + len(faces)
            place = np.searchsorted(known, keys[begin:end]).clip(max=len(known) - 1)
            found = (
                ~outside[begin:end] & (known[place] == keys[begin:end]) if len(known) else np.zeros(len(faces), bool)
            )
            if not found.all():
                raise InvalidInput(
                    f"{np.count_nonzero(~found)} of {len(faces)} faces of the boundary '{name}' are not on the surface "
                    f"of the mesh, the first is {faces[_first(~found)].tolist()}; remove those from the "
                    "group (if a cavity is meshed too, save only the volume of the wall)"
                )
            twice = repeated(place)
            if twice:
                raise InvalidInput(f"{twice} faces of the boundary '{name}' are listed twice; list each once")
            outward[name] = surface[place]
        return outward


def _first(mask: Any) -> int:
    return int(np.flatnonzero(mask)[0])
