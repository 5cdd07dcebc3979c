"""Values of a nodal field at given points of the mesh."""

from collections.abc import Mapping, Sequence

import numpy as np

from .errors import InputError
from .participants.native import Mesh, located
from .participants.participant import Values

#: Barycentric coordinate down to which a point still belongs to an element: meshes cut corners of curved walls.
_OUTSIDE = -0.25


class Probes:
    """Points in mm by name, located once; linear interpolation in the element that holds the point.

    A point that a facetted wall leaves outside by less than a quarter of an element takes the value at the nearest
    place of the mesh. Farther ones raise InputError.
    """

    def __init__(self, mesh: Mesh, points_mm: Mapping[str, Sequence[float]]) -> None:
        self.names = tuple(points_mm)
        self._places = located(mesh, list(points_mm.values()))
        for (name, point), lowest in zip(points_mm.items(), self._places.lowest, strict=True):
            if lowest < _OUTSIDE:
                nearest = mesh.points[np.linalg.norm(mesh.points - point, axis=1).argmin()]
                raise InputError(
                    f"output.probes_mm.{name}: the point {list(point)} lies outside the mesh; "
                    f"the nearest node is at {np.round(nearest, 2).tolist()} mm"
                )

    def __call__(self, field: Values) -> list[float]:
        """The values of a nodal field, shape (nodes,), at the points, in the order of `names`."""
        return self._places(field).tolist()  # type: ignore[no-any-return]
