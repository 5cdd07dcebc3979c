"""Where a unit's fields sit, as constants of its FMI 3.0 FMU: coordinates of nodes and of elements' centroids.

With them a tool can draw a field, or interpolate it, without this project's mesh; terminals group them with the
fields of their places. They are rounded to a nanometre, which halves their text, and left out where there are more
than 100 000 places of a kind: readers of the description would wait for megabytes that most of them never use.
"""

from dataclasses import dataclass, field

import numpy as np

from ..units.arrays import FloatArray
from ..units.mesh import Mesh
from ..units.unit import Unit
from ..units.variable import Causality, Location, Variable
from .layout import Run, layout

MOST_PLACES = 100_000
_DECIMALS = 6
_WHAT = {Location.NODE: "nodes", Location.ELEMENT: "elements' centroids"}


@dataclass(frozen=True)
class Coordinates(Run):
    """One coordinate in mm of all places of a kind: `values` has the shape (places,)."""

    values: FloatArray = field(compare=False)


def coordinates(unit: type[Unit], mesh: Mesh) -> tuple[Coordinates, ...]:
    """Those of the places on `mesh` where `unit` has fields; their value references follow those of its variables."""
    found: list[Coordinates] = []
    runs = layout(unit, mesh)
    for location, what in _WHAT.items():
        if all(run.variable.location is not location for run in runs):
            continue
        points = mesh.points if location is Location.NODE else mesh.points[mesh.cells].mean(axis=1)
        if len(points) > MOST_PLACES:
            continue
        # Without zeros of either sign.
        for axis, values in zip("xyz", (np.round(points, _DECIMALS) + 0.0).T, strict=True):
            description = f"coordinate {axis} of the {what}"
            variable = Variable(f"{location.value}_{axis}", Causality.OUTPUT, "mm", description, location, fixed=True)
            reference = runs[-1].reference + 1 + len(found)
            found.append(Coordinates(variable, (len(values),), -1, reference, values))
    return tuple(found)
