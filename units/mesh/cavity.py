"""The wall of a cavity that is open at the base, by whose faces alone its volume is known: the opening needs no lid."""

import numpy as np

from ..arrays import IntArray
from ..errors import InvalidInput
from .simplices import Mesh

_ML_PER_MM3 = 1e-3

#: Height in mm by which the rim of a cavity may leave its plane and still count as rounding.
_FLAT_RIM_MM = 1e-3


def cavity_faces(mesh: Mesh, boundaries: tuple[str, ...]) -> IntArray:
    """The wall of the cavity behind `boundaries`, open at the base, by its faces, normals out of the tissue.

    With n out of the tissue, the volume is −∫ x n_x over the wall. The opening adds nothing as long as its normal is
    the Z axis: the rim has to lie on the base, which does not move, and in one plane Z = constant.

    Raises
    ------
    InvalidInput
        Where it does not, and for what `checked_rim` refuses.
    """
    rim = checked_rim(mesh, boundaries)
    if len(rim) and np.ptp(mesh.points[rim, 2]) > _FLAT_RIM_MM:
        raise InvalidInput(
            f"the rim of the surface {' + '.join(boundaries)} at the base runs over "
            f"{np.ptp(mesh.points[rim, 2]):.3g} mm in Z; it has to lie in one plane Z = constant"
        )
    return _faces(mesh, boundaries)


def checked_rim(mesh: Mesh, boundaries: tuple[str, ...]) -> IntArray:
    """The nodes of the edge at which the cavity behind `boundaries` is open, none if it is closed.

    Raises
    ------
    InvalidInput
        Where it is open elsewhere than at the base, or encloses nothing: the surface seen from the other side.
    """
    faces = _faces(mesh, boundaries)
    rim = rim_of(faces)
    wall = " + ".join(boundaries)
    stray = np.setdiff1d(rim, mesh.boundary_nodes("base")) if len(rim) else rim
    if len(stray):
        raise InvalidInput(
            f"the surface {wall} has a rim off the base, at node {stray[0]} near "
            f"{np.round(mesh.points[stray[0]], 2).tolist()} mm; a cavity may be open at the base only: check that "
            "its boundaries cover all of its wall"
        )
    # Seen from a point of the opening's plane the lid has no volume, whichever way the plane lies.
    corners = mesh.points[faces] - mesh.points[rim if len(rim) else faces.ravel()].mean(axis=0)
    enclosed = -_ML_PER_MM3 * float(np.linalg.det(corners).sum()) / 6.0
    if enclosed <= 0.0:
        raise InvalidInput(
            f"the surface {wall} ({len(faces)} faces) encloses {enclosed:.3g} ml: it is the outside of a wall, not the "
            "inside of a cavity; check whether names of boundaries are exchanged"
        )
    return rim


def rim_of(faces: IntArray) -> IntArray:
    """The nodes on the edges that belong to one of `faces` only, shape (nodes,)."""
    edges = np.sort(faces[:, ((0, 1), (1, 2), (2, 0))], axis=2).reshape(-1, 2)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(unique[count == 1])


def _faces(mesh: Mesh, boundaries: tuple[str, ...]) -> IntArray:
    return np.concatenate([mesh.boundary(name) for name in boundaries])
