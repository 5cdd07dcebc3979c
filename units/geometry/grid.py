"""Scenes that need no mesh generator: a cell, a strand, a sheet and a slab, on regular grids."""

from itertools import pairwise

import numpy as np
from skfem import MeshTet, MeshTri

from ..arrays import FloatArray
from ..mesh import Mesh
from .size import check_size

#: Edge of strand, sheet and slab in mm.
_LENGTH_MM = 60.0
_SLAB_MM = 30.0
#: Thickness of the slab in mm: that of the left ventricle's wall.
_WALL_MM = 12.0
#: More elements in all, and more along a line, are a slip of units.
_MOST = 8_000_000
_MOST_LINES = 5000


def cell(size_mm: float) -> Mesh:
    """One point; the size has no meaning. It lies at (10, 0, 0), inside the box that is stimulated by default."""
    return Mesh(np.array([[10.0, 0.0, 0.0]]), np.array([[0]]))


def strand(size_mm: float) -> Mesh:
    """Lines along x from 0 to 60 mm; boundaries `left` and `right`."""
    check_size(size_mm, _LENGTH_MM / _MOST_LINES, _LENGTH_MM, _LENGTH_MM, 1)
    x = _axis(0.0, _LENGTH_MM, size_mm)
    points = np.column_stack([x, np.zeros((len(x), 2))])
    cells = np.array(list(pairwise(range(len(x)))))
    return Mesh(points, cells, {"left": np.array([[0]]), "right": np.array([[len(x) - 1]])})


def sheet(size_mm: float) -> Mesh:
    """Triangles over 60 × 60 mm of the x-y plane, from (0, −30) to (60, 30); boundary `left`."""
    triangles = 2.0 * _LENGTH_MM**2
    check_size(size_mm, (triangles / _MOST) ** (1 / 2), _LENGTH_MM, triangles, 2)
    x, y = _axis(0.0, _LENGTH_MM, size_mm), _axis(-_LENGTH_MM / 2.0, _LENGTH_MM / 2.0, size_mm)
    grid = MeshTri.init_tensor(x, y)
    points = np.column_stack([grid.p.T, np.zeros(grid.p.shape[1])])
    mesh = Mesh(points, _positive(points[:, :2], grid.t.T))
    return Mesh(mesh.points, mesh.cells, {"left": _faces(mesh, 0, 0.0)})


def slab(size_mm: float) -> Mesh:
    """Tetrahedra of a piece of wall, 30 × 12 × 30 mm below the base plane Z = 0, with rotating fibres across y.

    Boundaries `base` (Z = 0), `endocardium` (y = −6 mm) and `epicardium` (y = 6 mm).
    """
    half, tetrahedra = _WALL_MM / 2.0, 6.0 * _SLAB_MM**2 * _WALL_MM
    check_size(size_mm, (tetrahedra / _MOST) ** (1 / 3), _WALL_MM, tetrahedra, 3)
    axes = _axis(0.0, _SLAB_MM, size_mm), _axis(-half, half, size_mm), _axis(-_SLAB_MM, 0.0, size_mm)
    grid = MeshTet.init_tensor(*axes)
    mesh = Mesh(grid.p.T, _positive(grid.p.T, grid.t.T))
    sides = {"base": (2, 0.0), "endocardium": (1, -half), "epicardium": (1, half)}
    return Mesh(mesh.points, mesh.cells, {name: _faces(mesh, axis, at) for name, (axis, at) in sides.items()})


def _axis(begin: float, end: float, size_mm: float) -> FloatArray:
    """From `begin` to `end` in equal parts of about the size."""
    length = end - begin
    return np.linspace(begin, end, round(length / size_mm) + 1)


def _positive(points: FloatArray, cells: np.ndarray) -> np.ndarray:
    """The elements, two nodes exchanged where the volume would be negative."""
    inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0.0
    cells = cells.copy()
    cells[inverted, :2] = cells[inverted, 1::-1]
    return cells


def _faces(mesh: Mesh, axis: int, at: float) -> np.ndarray:
    """The faces of the surface that lie at a coordinate; those of a grid do so exactly."""
    return np.asarray(mesh.surface[(mesh.points[mesh.surface][:, :, axis] == at).all(axis=1)])
