"""The biventricular anatomy of docs/model.md: two truncated ellipsoids grown together."""

import math
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..mesh import Mesh
from .ellipsoid import SemiAxes, crescent_volume, half_ellipsoid_volume, half_shell_volume, level, shrunk
from .gmsh_session import gmsh_model, tetrahedralise
from .half_ellipsoid import Solids, half_ellipsoid
from .size import check_size

#: Below this edge length the anatomy has more than eight million elements; such a number is a slip of units.
FINEST_SIZE_MM = 0.4

#: Tetrahedra that gmsh makes of a volume of the cube of their size.
TETRAHEDRA_PER_CUBE = 6.0

# How far the nodes of a surface may be from the ellipsoid it is named for, as a part of the semi-axes: the surfaces
# meet in curves that OpenCASCADE fits to 1e-7 mm.
_ON_SURFACE = 1e-5


@dataclass(frozen=True)
class Biventricle:
    """Left and right ventricle as one tissue, cut at the base plane Z = 0, apex at −Z; lengths in mm.

    The outer ellipsoids have the same semi-axis along y, so they touch at (0, ±y, 0) and cross in a plane through the
    y axis. A right ventricular wall made as a body of its own tapers there to a wedge of zero angle, which no mesh of
    good elements fills. Here the outer shape is put together from the half of either ellipsoid on its side of that
    plane: no wedge arises, no stray piece of the right ventricle lies inside the left one, and nothing of the wall
    has to be cut off to blunt it.

    Parameters
    ----------
    lv_outer, rv_outer:
        Semi-axes (x, y, z) of the outer surfaces.
    lv_wall, rv_wall:
        By how much the semi-axes of the inner surfaces are shorter.
    """

    lv_outer: SemiAxes = (30.0, 30.0, 70.0)
    lv_wall: float = 12.0
    rv_outer: SemiAxes = (51.0, 30.0, 60.0)
    rv_wall: float = 6.0

    def __post_init__(self) -> None:
        lengths = (*self.lv_outer, self.lv_wall, *self.rv_outer, self.rv_wall)
        if not all(math.isfinite(length) and length > 0.0 for length in lengths):
            raise InvalidInput(f"semi-axes and walls must be positive and finite, got {lengths} mm")
        if min(*self.lv_inner, *self.rv_inner) <= 0.0:
            raise InvalidInput(f"the walls ({self.lv_wall:g} and {self.rv_wall:g} mm) leave no cavity")
        (lv_x, lv_y, lv_z), (rv_x, rv_y, rv_z) = self.lv_outer, self.rv_outer
        if rv_y != lv_y or rv_z >= lv_z or rv_x - self.rv_wall <= lv_x:
            raise InvalidInput(
                f"the right ventricle {self.rv_outer} must have the y semi-axis of the left one {self.lv_outer}, "
                f"a shorter z semi-axis, and inside its wall of {self.rv_wall:g} mm a longer x semi-axis"
            )

    @property
    def lv_inner(self) -> SemiAxes:
        """Semi-axes of the left ventricle's cavity."""
        return shrunk(self.lv_outer, self.lv_wall)

    @property
    def rv_inner(self) -> SemiAxes:
        """Semi-axes of the ellipsoid that bounds the right ventricle's cavity."""
        return shrunk(self.rv_outer, self.rv_wall)

    @property
    def lv_wall_volume(self) -> float:
        """Exact volume of the left ventricular wall, septum included, in mm³."""
        return half_shell_volume(self.lv_outer, self.lv_wall)

    @property
    def lv_cavity_volume(self) -> float:
        """Exact volume of the left ventricular cavity in mm³."""
        return half_ellipsoid_volume(self.lv_inner)

    @property
    def rv_wall_volume(self) -> float:
        """Exact volume of the right ventricular wall, outside the left ventricle, in mm³."""
        return crescent_volume(self.rv_outer, self.lv_outer) - self.rv_cavity_volume

    @property
    def rv_cavity_volume(self) -> float:
        """Exact volume of the right ventricular cavity in mm³."""
        return crescent_volume(self.rv_inner, self.lv_outer)

    def mesh(self, size_mm: float) -> Mesh:
        """Tetrahedra with edges of about `size_mm`; the same call gives the same mesh.

        Boundaries: `base`, `epicardium`, `lv_endocardium`, `rv_endocardium` and `rv_septum`. Both ventricles'
        cavities are closed by them but for the opening in the base plane, where all rim nodes have Z = 0 exactly.

        Raises
        ------
        InvalidInput
            For a size the anatomy cannot be meshed with, or if gmsh does not load.
        """
        volume = self.lv_wall_volume + self.rv_wall_volume
        check_size(size_mm, FINEST_SIZE_MM, self.lv_wall, TETRAHEDRA_PER_CUBE * volume, 3)
        with gmsh_model(size_mm) as gmsh:
            self.solid(gmsh)
            points, cells, surfaces = tetrahedralise(gmsh)
        points[np.abs(points[:, 2]) < _ON_SURFACE, 2] = 0.0
        parts: dict[str, list[np.ndarray]] = {}
        for faces in surfaces:
            parts.setdefault(self._name(points[np.unique(faces)]), []).append(faces)
        boundaries = {name: np.concatenate(parts[name]) for name in sorted(parts)}
        return Mesh(points, cells, boundaries)

    def solid(self, gmsh: ModuleType) -> int:
        """Build the tissue in the current gmsh model; returns the number of the only volume."""
        occ = gmsh.model.occ
        lv_side, _ = occ.cut(half_ellipsoid(occ, self.lv_outer), _half_space(occ, self._crossing_slope))
        rv_side, _ = occ.intersect(half_ellipsoid(occ, self.rv_outer), _half_space(occ, self._crossing_slope))
        rv_cavity, _ = occ.intersect(half_ellipsoid(occ, self.rv_inner), _half_space(occ, 0.0))
        rv_cavity, _ = occ.cut(rv_cavity, half_ellipsoid(occ, self.lv_outer))
        # The cavity goes before the sides are joined: afterwards it shares an outer surface with the left ventricle
        # that is gone, and OpenCASCADE keeps a copy of it.
        rv_side, _ = occ.cut(rv_side, rv_cavity)
        outer, _ = occ.fuse(lv_side, rv_side)
        occ.cut(outer, half_ellipsoid(occ, self.lv_inner))
        occ.synchronize()
        volumes = gmsh.model.getEntities(3)
        if len(volumes) != 1:
            raise InvalidInput(f"{self} makes {len(volumes)} bodies, expected one: choose other semi-axes or walls")
        return int(volumes[0][1])

    @property
    def _crossing_slope(self) -> float:
        """The k of the plane X = −k Z in which the outer surfaces cross, the right one being outside for X > −k Z."""
        (lv_x, _, lv_z), (rv_x, _, rv_z) = self.lv_outer, self.rv_outer
        return math.sqrt((1.0 / rv_z**2 - 1.0 / lv_z**2) / (1.0 / lv_x**2 - 1.0 / rv_x**2))

    def _name(self, nodes: FloatArray) -> str:
        """The boundary that a surface with these nodes (n, 3) belongs to."""

        def on(axes: SemiAxes) -> bool:
            return bool((np.abs(level(axes, nodes)) < _ON_SURFACE).all())

        if not nodes[:, 2].any():
            return "base"
        if on(self.lv_inner):
            return "lv_endocardium"
        if on(self.rv_inner):
            return "rv_endocardium"
        if not (on(self.lv_outer) or on(self.rv_outer)):
            raise RuntimeError(f"a surface with nodes such as {nodes[0]} is on none of the ellipsoids")
        in_rv_cavity = (nodes[:, 0] > 0.0) & (level(self.rv_inner, nodes) < _ON_SURFACE)
        return "rv_septum" if in_rv_cavity.all() else "epicardium"


def _half_space(occ: ModuleType, slope: float) -> Solids:
    """The side X > −slope Z of a plane through the y axis, as a box larger than any heart."""
    size = 1000.0
    box = [(3, occ.addBox(0, -size, -size, size, 2 * size, 2 * size))]
    occ.rotate(box, 0, 0, 0, 0, 1, 0, -math.atan(slope))
    return box
