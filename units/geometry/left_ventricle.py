"""The left ventricle alone: one truncated ellipsoid (docs/model.md, Geometry)."""

from dataclasses import dataclass

import numpy as np

from ..mesh import Mesh
from .biventricle import FINEST_SIZE_MM, TETRAHEDRA_PER_CUBE
from .ellipsoid import SemiAxes, half_ellipsoid_volume, half_shell_volume, level, shrunk
from .gmsh_session import gmsh_model, tetrahedralise
from .half_ellipsoid import half_ellipsoid
from .size import check_size

# Nodes lie on the surface of revolution up to rounding.
_ON_SURFACE = 1e-5


@dataclass(frozen=True)
class LeftVentricle:
    """The wall between two half ellipsoids, cut at the base plane Z = 0, apex at −Z; lengths in mm."""

    outer: SemiAxes = (30.0, 30.0, 70.0)
    wall: float = 12.0

    @property
    def wall_volume(self) -> float:
        """Exact volume of the wall in mm³."""
        return half_shell_volume(self.outer, self.wall)

    @property
    def cavity_volume(self) -> float:
        """Exact volume of the cavity in mm³."""
        return half_ellipsoid_volume(shrunk(self.outer, self.wall))

    def mesh(self, size_mm: float) -> Mesh:
        """Tetrahedra with edges of about `size_mm`; boundaries `base`, `epicardium` and `lv_endocardium`.

        InvalidInput for a size the anatomy cannot be meshed with, or if gmsh does not load.
        """
        check_size(size_mm, FINEST_SIZE_MM, self.wall, TETRAHEDRA_PER_CUBE * self.wall_volume, 3)
        with gmsh_model(size_mm) as gmsh:
            occ = gmsh.model.occ
            occ.cut(half_ellipsoid(occ, self.outer), half_ellipsoid(occ, shrunk(self.outer, self.wall)))
            occ.synchronize()
            points, cells, surfaces = tetrahedralise(gmsh)
        points[np.abs(points[:, 2]) < _ON_SURFACE, 2] = 0.0
        parts: dict[str, list[np.ndarray]] = {}
        for faces in surfaces:
            nodes = points[np.unique(faces)]
            inside = (np.abs(level(shrunk(self.outer, self.wall), nodes)) < _ON_SURFACE).all()
            name = "base" if not nodes[:, 2].any() else "lv_endocardium" if inside else "epicardium"
            parts.setdefault(name, []).append(faces)
        return Mesh(points, cells, {name: np.concatenate(parts[name]) for name in sorted(parts)})
