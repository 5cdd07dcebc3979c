"""Values of a nodal field at given points of the mesh."""

from collections.abc import Mapping, Sequence

import numpy as np

from .errors import InputError
from .participants.native import Mesh
from .participants.participant import Values

#: Barycentric coordinate down to which a point still belongs to an element: meshes cut corners of curved walls.
_OUTSIDE = -0.25

#: Distance in mm from the plane or line of a scene that is rounding.
_OFF_AXIS_MM = 1e-6


class Probes:
    """Points in mm by name, located once; linear interpolation in the element that holds the point.

    A point that a facetted wall leaves outside by less than a quarter of an element takes the value at the nearest
    place of the nearest element. Farther ones raise InputError.
    """

    def __init__(self, mesh: Mesh, points_mm: Mapping[str, Sequence[float]]) -> None:
        self.names = tuple(points_mm)
        corners = mesh.points[mesh.cells]
        inside_axes = slice(mesh.dimension)
        inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1])[:, :, inside_axes])
        self._nodes, self._weights = [], []
        for name, point in points_mm.items():
            offset = np.asarray(point) - corners[:, 0]
            others = np.einsum("ei,eij->ej", offset[:, inside_axes], inverse)
            weights = np.column_stack([1.0 - others.sum(axis=1), others])
            # Scenes of fewer dimensions lie in the first axes; off them is outside.
            weights[np.abs(offset[:, mesh.dimension :]).max(axis=1, initial=0.0) > _OFF_AXIS_MM] = -np.inf
            element = int(weights.min(axis=1).argmax())
            if not weights[element].min() >= _OUTSIDE:
                nearest = mesh.points[np.linalg.norm(mesh.points - point, axis=1).argmin()]
                raise InputError(
                    f"output.probes_mm.{name}: the point {list(point)} lies outside the mesh; "
                    f"the nearest node is at {np.round(nearest, 2).tolist()} mm"
                )
            inside = np.clip(weights[element], 0.0, None)
            self._nodes.append(mesh.cells[element])
            self._weights.append(inside / inside.sum())

    def __call__(self, field: Values) -> list[float]:
        """The values of a nodal field, shape (nodes,), at the points, in the order of `names`."""
        return [float(weights @ field[nodes]) for nodes, weights in zip(self._nodes, self._weights, strict=True)]
