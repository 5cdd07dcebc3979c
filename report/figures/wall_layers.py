"""The surfaces of the wall and the one half-way through it, as they are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ...orchestrator.participants.participant import Values
from .skin import Skin
from .surface import Numbers, normals, section
from .tissue import nodal_mean
from .transmural_directions import within_wall

#: The inner surfaces of the wall. The septum's right side counts as outer, as it does for the fibres.
INNER = ("lv_endocardium", "rv_endocardium", "endocardium")
OUTER = ("epicardium", "rv_septum")

# Triangles of less area are points or lines.
_AREA_MM2 = 1e-9


@dataclass(frozen=True)
class Layer:
    """A surface of the wall or through it, seen from its outer side.

    Corners in mm, shape (faces, 3, 3), with the angle in degrees, shape (faces, 3), and the outward unit normals at
    them, shape (faces, 3, 3); and the direction of the fibres in each face, shape (faces, 3).
    """

    corners: Values
    angle: Values
    normals: Values
    fiber: Values

    @cached_property
    def face_normals(self) -> Values:
        """Outward unit normals of the faces themselves, shape (faces, 3)."""
        return normals(self.corners.reshape(-1, 3), np.arange(self.angle.size).reshape(-1, 3))


def surfaces(boundaries: Mapping[str, Numbers]) -> tuple[Numbers, Numbers] | None:
    """The faces of the inner and of the outer surface of the wall, shape (faces, 3); None where one has no name."""
    inner = [boundaries[name] for name in INNER if name in boundaries]
    outer = [boundaries[name] for name in OUTER if name in boundaries]
    return (np.concatenate(inner), np.concatenate(outer)) if inner and outer else None


def depths(points: Values, inner: Numbers, outer: Numbers) -> Values:
    """The distance from the outer surface over the sum of both distances, at nodes in mm, shape (nodes, 3).

    Distances are those to the nearest node of a surface, which is enough for a picture.
    """
    to_outer, to_inner = (cKDTree(points[np.unique(faces)]).query(points)[0] for faces in (outer, inner))
    return np.asarray(to_outer / np.maximum(to_outer + to_inner, 1e-9))


def layers_of_the_wall(skin: Skin, outward: Values, angle: Values, inner: Numbers, outer: Numbers) -> dict[str, Layer]:
    """The outer surface of the wall, the one half-way through it, and the inner one, all seen from outside.

    The angle varies from element to element with the depth of their centres. What is drawn is interpolated between
    the nodes, in the middle of the wall above all.
    """
    mesh = skin.mesh
    at_nodes = np.column_stack([mesh.points, nodal_mean(mesh, np.column_stack([angle, outward]))])
    halfway, _ = section(at_nodes, mesh.cells, depths(mesh.points, inner, outer) - 0.5)
    found = {}
    for name, corners in (
        ("epicardium", at_nodes[skin.faces[skin.places(outer)]]),
        ("mid-wall", halfway),
        ("endocardium", at_nodes[skin.faces[skin.places(inner)]]),
    ):
        across = np.cross(corners[:, 1, :3] - corners[:, 0, :3], corners[:, 2, :3] - corners[:, 0, :3])
        # A surface that meets a node has triangles without area there.
        corners, across = (values[np.linalg.norm(across, axis=1) > _AREA_MM2] for values in (corners, across))
        inward = np.einsum("ni,ni->n", across, corners[..., 4:].mean(axis=1)) < 0.0
        corners[inward] = corners[inward][:, ::-1]
        out = corners[..., 4:] / np.maximum(np.linalg.norm(corners[..., 4:], axis=2, keepdims=True), 1e-12)
        along, around = within_wall(out.mean(axis=1))
        theta = np.radians(corners[..., 3].mean(axis=1))[:, None]
        # The product of the direction through the wall and the one along it leads clockwise, as seen from above.
        found[name] = Layer(corners[..., :3], corners[..., 3], out, np.sin(theta) * along - np.cos(theta) * around)
    return found
