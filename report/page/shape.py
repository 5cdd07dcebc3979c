"""What of a scene's mesh is drawn: triangles, and where their nodes are in every frame."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from ..figures.surface import Numbers, normals, smoothing, surface

#: A strand is drawn as a tube with so many sides, whose radius is this part of the strand's length.
_SIDES, _THIN = 8, 1 / 45


@dataclass(frozen=True)
class Shape:
    """The undeformed shape, in mm.

    Attributes
    ----------
    points:
        Of the drawn nodes, shape (n, 3).
    cells:
        The elements by the mesh's nodes, shape (elements, 2 to 4).
    triangles, element:
        By the drawn nodes, shape (m, 3), outward where there is an outside, and the element of each, shape (m,).
    node:
        The mesh's node whose values and displacement each drawn node has, shape (n,).
    """

    points: Values
    cells: Numbers
    triangles: Numbers
    element: Numbers
    node: Numbers

    @property
    def is_solid(self) -> bool:
        """Whether there is an inside to look into."""
        return self.cells.shape[1] == 4

    @property
    def is_strand(self) -> bool:
        """Whether it is a line that is drawn as a tube."""
        return self.cells.shape[1] == 2

    @property
    def is_flat(self) -> bool:
        """Whether it lies in a horizontal plane at rest."""
        return not self.is_strand and bool(np.ptp(self.points[:, 2]) < 1e-6 * self.size_mm)

    @property
    def nodes(self) -> int:
        """Number of the mesh's nodes."""
        return int(self.node.max()) + 1

    @property
    def size_mm(self) -> float:
        """Its longest side."""
        return float(np.ptp(self.points, axis=0).max())

    @cached_property
    def corner_groups(self) -> NDArray[np.int64]:
        """A number for each corner, shape (m, 3): corners of a node have the same where the surface is smooth."""
        if not self.is_solid:
            return np.zeros_like(self.triangles)
        at_corners = smoothing(self.points, self.triangles) @ normals(self.points, self.triangles)
        _, group = np.unique(np.rint(at_corners * 1e4), axis=0, return_inverse=True)
        return np.asarray(group.reshape(-1, 3))

    def at_nodes(self, values: Values) -> Values:
        """Values of elements, shape (..., elements), as means at the mesh's nodes, weighted with their sizes."""
        corners = self.cells.shape[1]
        count = self.nodes
        weight = np.repeat(self._sizes, corners)
        total = np.bincount(self.cells.ravel(), weight, count)
        rows = [
            np.bincount(self.cells.ravel(), weight * np.repeat(row, corners), count)
            for row in values.reshape(-1, len(self.cells))
        ]
        return np.array(rows).reshape(*values.shape[:-1], count) / np.maximum(total, 1e-300)

    @property
    def _sizes(self) -> Values:
        """Length, area or volume of the elements, but for a factor that is the same for all."""
        edges = self.points[self._first(self.cells[:, 1:])] - self.points[self._first(self.cells[:, :1])]
        return np.asarray(np.sqrt(np.abs(np.linalg.det(edges @ edges.transpose(0, 2, 1)))))

    def _first(self, nodes: Numbers) -> Numbers:
        """The first drawn node of each of the mesh's nodes."""
        return np.asarray(nodes * (_SIDES if self.is_strand else 1))


def shape_of(run: StoredRun) -> Shape | None:
    """The shape of a run's scene; None where there is none: no mesh, or a single point."""
    points, cells = run.points_mm, run.cells
    if points is None or cells is None or not 2 <= cells.shape[1] <= 4 or not len(cells):
        return None
    every = np.arange(len(points))
    if cells.shape[1] == 4:
        triangles, element = surface(cells)
        return Shape(points, cells, triangles, element, every)
    if cells.shape[1] == 3:
        return Shape(points, cells, cells, np.arange(len(cells)), every)
    return _tube(points, cells)


def _tube(points: Values, cells: Numbers) -> Shape:
    """A tube around a line."""
    along = points[cells[:, 1]] - points[cells[:, 0]]
    main = along.sum(axis=0) / max(float(np.linalg.norm(along.sum(axis=0))), 1e-300)
    first = np.cross(main, np.eye(3)[np.abs(main).argmin()])
    first /= np.linalg.norm(first)
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(main, first))
    ring *= _THIN * float(np.ptp(points, axis=0).max())
    side = np.arange(_SIDES)
    after = (side + 1) % _SIDES
    start, end = (_SIDES * cells[:, place, None] for place in (0, 1))
    quads = [(start + side, end + after, end + side), (start + side, start + after, end + after)]
    triangles = np.concatenate([np.stack(quad, axis=2).reshape(-1, 3) for quad in quads])
    element = np.tile(np.repeat(np.arange(len(cells)), _SIDES), 2)
    return Shape(
        (points[:, None] + ring).reshape(-1, 3), cells, triangles, element, np.repeat(np.arange(len(points)), _SIDES)
    )
