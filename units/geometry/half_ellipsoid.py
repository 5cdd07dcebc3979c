"""Half an ellipsoid as a solid of gmsh's OpenCASCADE kernel."""

import math
from types import ModuleType

from .ellipsoid import SemiAxes

#: Dimension and number of entities of a gmsh model.
Solids = list[tuple[int, int]]


def half_ellipsoid(occ: ModuleType, axes: SemiAxes) -> Solids:
    """The part of an ellipsoid with Z < 0, by turning a quarter of an ellipse around the z axis.

    (A stretched sphere has the same shape, but OpenCASCADE is 1 % wrong on its volume.) The seam is at X < 0, clear of
    the right ventricle.
    """
    a, b, c = axes
    centre, rim, apex = occ.addPoint(0, 0, 0), occ.addPoint(-a, 0, 0), occ.addPoint(0, 0, -c)
    arc = occ.addEllipseArc(rim, centre, apex if c > a else rim, apex)
    loop = occ.addCurveLoop([arc, occ.addLine(apex, centre), occ.addLine(centre, rim)])
    profile = [(2, occ.addPlaneSurface([loop]))]
    solid = [entity for entity in occ.revolve(profile, 0, 0, 0, 0, 0, 1, 2 * math.pi) if entity[0] == 3]
    occ.remove(profile, recursive=True)
    if b != a:
        occ.dilate(solid, 0, 0, 0, 1, b / a, 1)
    return solid
