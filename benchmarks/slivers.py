"""The meshes of scenarios/stability/slivers*.yaml: a piece of wall with elements of 6 mm, two of which are nearly flat.

The inner node nearest to the centre is pushed towards the opposite face of one of its tetrahedra. This tetrahedron
becomes flat, and so does the one beside it, whose opposite face lies in the same plane. Everything else stays as it is,
so that the maps show the effect of a single sliver on a mesh that is sound without it. `python -m benchmarks.slivers`
writes the meshes.
"""

from pathlib import Path

import numpy as np
from cardiac_cosim.units.arrays import FloatArray
from cardiac_cosim.units.geometry.grid import slab
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.archive import pack_mesh
from cardiac_cosim.units.mesh.quality import signed_inverse_condition_number
from scipy.optimize import brentq

FOLDER = Path(__file__).parent.parent / "scenarios" / "stability" / "meshes"

#: Signed inverse condition numbers of the worst element.
QUALITIES = (0.3, 0.1, 0.03, 0.01, 0.003, 0.001)

_SIZE_MM = 6.0

#: Largest fraction of the way to the face: beyond it, the quality is that of no valid element.
_NEARLY = 1.0 - 1e-6

#: Tolerance of the fraction of the way by which the node is pushed.
_TOLERANCE = 1e-14


def sliver_file(quality: float) -> Path:
    """Where the mesh of that quality is."""
    return FOLDER / f"slab_sicn_{quality:g}.npz"


def sliver_mesh(quality: float) -> Mesh:
    """The mesh whose worst element has that `quality`, a signed inverse condition number; the others stay above it."""
    mesh = slab(_SIZE_MM)
    node = _inner_node(mesh)
    way = _to_opposite_face(mesh, node)

    def excess(part: float) -> float:
        return float(signed_inverse_condition_number(_pushed(mesh, node, part * way)).min()) - quality

    # Where the node reaches the face, the element is flat, and the mesh is invalid.
    return _pushed(mesh, node, brentq(excess, 0.0, _NEARLY, xtol=_TOLERANCE) * way)


def _inner_node(mesh: Mesh) -> int:
    """The node nearest to the centre of those that are on no surface."""
    inner = np.setdiff1d(np.arange(mesh.nodes), mesh.surface)
    centre = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))
    return int(inner[np.linalg.norm(mesh.points[inner] - centre, axis=1).argmin()])


def _to_opposite_face(mesh: Mesh, node: int) -> FloatArray:
    """The vector in mm from a node to the middle of the opposite face of the first of its elements."""
    element = mesh.cells[(mesh.cells == node).any(axis=1)][0]
    return np.asarray(mesh.points[element[element != node]].mean(axis=0) - mesh.points[node])


def _pushed(mesh: Mesh, node: int, by: FloatArray) -> Mesh:
    points = mesh.points.copy()
    points[node] += by
    return Mesh(points, mesh.cells, mesh.boundaries)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for each in QUALITIES:
        pack_mesh(sliver_mesh(each), sliver_file(each))
