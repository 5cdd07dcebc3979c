"""The left ventricle's wall in a mesh that has one: its tissue, the septum included, and the directions in it.

A mesh says which surfaces bound the tissue, not where the left ventricle ends and the right one begins. The septum is
counted with the left ventricle, as left ventricular mass is in the clinic (Cerqueira et al. 2002, Circulation 105,
539-542).
"""

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import FloatArray
from .simplices import Mesh
from .transmural import transmural_direction
from .wall import wall_of

#: Difference of two distances in mm that is rounding.
_SAME_MM = 1e-6

#: 1 − |cosine| of the angle between the transmural direction and the Z axis below which the axis gives no direction in
#: the wall.
_VERTICAL = 1e-12


def lv_tissue(mesh: Mesh) -> np.ndarray:
    """Which elements are tissue of the left ventricle, shape (elements,); of a left ventricle alone all are.

    Beside a right ventricle, an element belongs to the left one if its centroid is nearer to the left endocardium, or
    to the septum's right side, than to the right endocardium. Where the junction of septum and right free wall is
    nearest, which bounds both, it belongs to the left ventricle if it is no farther from the left endocardium than the
    septum is thick on average. On the shipped biventricle this is the tissue inside the left ventricle's outer
    ellipsoid but for 1 % of its volume.

    Raises
    ------
    InvalidInput
        Where boundaries are missing or contradict each other.
    """
    if "rv_volume" not in wall_of(mesh).cavities:
        return np.ones(mesh.elements, dtype=bool)
    places = {name: _places(mesh, name) for name in ("lv_endocardium", "rv_septum", "rv_endocardium")}
    left, septum, right = (cKDTree(points).query(mesh.centroids)[0] for points in places.values())
    thickness = cKDTree(places["lv_endocardium"]).query(places["rv_septum"])[0].mean()
    at_junction = (np.abs(septum - right) <= _SAME_MM) & (septum <= left)
    return np.asarray(np.where(at_junction, left <= thickness, np.minimum(left, septum) < right))


def _places(mesh: Mesh, boundary: str) -> FloatArray:
    """Nodes and centres of the faces of a boundary: near enough to tell surfaces apart, and found at once."""
    faces = mesh.boundary(boundary)
    return np.vstack([mesh.points[np.unique(faces)], mesh.points[faces].mean(axis=1)])


def wall_directions(mesh: Mesh) -> dict[str, FloatArray]:
    """Unit vectors per element, each of shape (elements, 3): `radial`, `longitudinal` and `circumferential`.

    Radial is the way through the wall, outward (`transmural`); longitudinal is the Z axis made normal to that, towards
    the base; circumferential is normal to both. They are told from the mesh, whatever fibres and sheets it is given.
    Where the way through the wall is vertical, in single elements at the very apex, any direction in the wall is as
    good, and the X axis takes the Z axis' place.

    Raises
    ------
    InvalidInput
        Where boundaries are missing or contradict each other, and for a wall too coarse to have a way through it.
    """
    wall = wall_of(mesh)
    radial = transmural_direction(mesh, wall.endocardium, wall.epicardium)
    vertical = np.abs(radial[:, 2]) > 1.0 - _VERTICAL
    upward = np.where(vertical[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    longitudinal = upward - np.einsum("ei,ei->e", upward, radial)[:, None] * radial
    longitudinal /= np.linalg.norm(longitudinal, axis=1, keepdims=True)
    return {"radial": radial, "longitudinal": longitudinal, "circumferential": np.cross(radial, longitudinal)}
