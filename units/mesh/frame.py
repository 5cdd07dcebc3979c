"""Whether a mesh stands in the frame that the units take for granted: mm, base on top at Z = 0, apex below.

The fibre rule, the stimulus box and the ionic time scale are written in that frame (docs/model.md, Geometry), and a
heart in cm or on its head gives plausible numbers all the same.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from ..errors import InvalidInput
from .cavity import rim_of
from .simplices import Mesh

#: Largest extents in mm that are plausible for a heart, and such beyond which the unit of length must be another one.
_HEART_MM, _NO_HEART_MM = (40.0, 250.0), (20.0, 400.0)
#: The same for a piece of wall.
_PIECE_MM, _NO_PIECE_MM = (10.0, 300.0), (1.0, 1000.0)

#: Cosine of the angle between the base's normal and the Z axis below which it is tilted, and no base on top at all.
_TILTED, _TURNED = 0.985, 0.7
#: Distance of the base from Z = 0, relative to the height, that is worth a word, and that is another frame.
_OFF, _ELSEWHERE = 0.01, 0.1
#: How far in mm the left ventricle may be from the Z axis.
_OFF_AXIS_MM = 10.0
#: Nodes nearer to each other than this part of a mean edge lie at the same place.
_COINCIDENT = 1e-3

_FRAME = "lengths are in mm, the base is the highest plane, at Z = 0, and the apex lies below it, at negative Z"


def is_heart(mesh: Mesh) -> bool:
    """Whether the boundaries of `mesh` are those of one or two ventricles."""
    return mesh.dimension == 3 and bool({"lv_endocardium", "rv_endocardium", "rv_septum"} & set(mesh.boundaries))


def check_frame(mesh: Mesh, unit_is_stated: bool) -> None:
    """Refuse a mesh in another frame.

    Raises
    ------
    InvalidInput
        For a size that no heart has, unless the mesh's unit of length is stated, and for a heart whose base is not on
        top at Z = 0.
    """
    if mesh.dimension < 3:
        return
    low, high = _NO_HEART_MM if is_heart(mesh) else _NO_PIECE_MM
    largest = float(np.ptp(mesh.points, axis=0).max())
    if not unit_is_stated and not low <= largest <= high:
        raise InvalidInput(
            f"{_size(mesh)}; expected {low:g} to {high:g} mm: if its coordinates are in another unit of length, state "
            "it (scene: {scale: cm} or m, or a number that makes mm of them), and if they are in mm, scale: mm"
        )
    if not is_heart(mesh) or "base" not in mesh.boundaries:
        return
    normal, height, level = _base(mesh)
    if normal[2] < _TURNED:
        raise InvalidInput(
            f"the base faces in the direction {np.round(normal + 0.0, 2).tolist()} and not upward, [0, 0, 1]: "
            f"{_FRAME}; turn the mesh"
        )
    if abs(level) > _ELSEWHERE * height:
        raise InvalidInput(
            f"the base lies at Z = {level:.3g} mm, the lowest point at Z = {mesh.points[:, 2].min():.3g} mm: {_FRAME}; "
            f"move the mesh by {-level:.3g} mm along Z"
        )


def frame_warnings(mesh: Mesh, unit_is_stated: bool) -> Iterator[str]:
    """What is unusual of the place and the size of a mesh, in sentences for a person."""
    if mesh.dimension < 3:
        return
    low, high = _HEART_MM if is_heart(mesh) else _PIECE_MM
    if not unit_is_stated and not low <= np.ptp(mesh.points, axis=0).max() <= high:
        yield f"{_size(mesh)}; is it in another unit of length than mm? Then state scene.scale"
    yield from _coincident(mesh)
    if "base" not in mesh.boundaries:
        return
    normal, height, level = _base(mesh)
    if normal[2] < _TILTED:
        yield f"the base is tilted by {np.degrees(np.arccos(np.clip(normal[2], -1.0, 1.0))):.0f} degrees; {_FRAME}"
    if abs(level) > _OFF * height:
        yield f"the base lies at Z = {level:.3g} mm; {_FRAME}"
    above = float(mesh.points[:, 2].max()) - level
    if above > _OFF * height:
        yield f"the mesh reaches {above:.3g} mm above its base; {_FRAME}"
    if is_heart(mesh) and "lv_endocardium" in mesh.boundaries:
        yield from _sideways(mesh)


def apex_warnings(mesh: Mesh, apex_z_mm: float) -> Iterator[str]:
    """Where the apex that a parameter names is not that of the mesh."""
    if not is_heart(mesh):
        return
    lowest, height = float(mesh.points[:, 2].min()), float(np.ptp(mesh.points[:, 2]))
    if abs(apex_z_mm - lowest) > _ELSEWHERE * height:
        yield (
            f"apex_z_mm is {apex_z_mm:.4g}, but the lowest point of the mesh is at Z = {lowest:.4g} mm; give "
            f"apex_z_mm: {lowest:.4g}"
        )


def _sideways(mesh: Mesh) -> Iterator[str]:
    rim = rim_of(mesh.boundary("lv_endocardium"))
    left = mesh.points[rim if len(rim) else mesh.boundary_nodes("lv_endocardium")].mean(axis=0)
    if np.hypot(*left[:2]) > _OFF_AXIS_MM:
        yield (
            f"the left ventricle opens at X = {left[0]:.3g}, Y = {left[1]:.3g} mm; the stimulus and the probes "
            "assume that it is centred on the Z axis"
        )
    if "rv_endocardium" in mesh.boundaries:
        right = mesh.points[mesh.boundary_nodes("rv_endocardium")].mean(axis=0)
        if right[0] - left[0] < abs(right[1] - left[1]):
            yield (
                f"the right ventricle lies in the direction X {right[0] - left[0]:+.3g}, Y {right[1] - left[1]:+.3g} "
                "mm from the left one; the stimulus assumes that it lies at positive X"
            )


def _coincident(mesh: Mesh) -> Iterator[str]:
    """Nodes that another mesher would have made one: the tissue is torn between them."""
    nodes = np.unique(mesh.surface)
    points = mesh.points[nodes]
    edge = float(np.cbrt(6.0 * np.sqrt(2.0) * np.median(mesh.volumes)))
    distance, found = cKDTree(points).query(points, k=2, distance_upper_bound=_COINCIDENT * edge)
    near = np.flatnonzero(np.isfinite(distance[:, 1]))
    # Of two nodes at one place either may be found first.
    other = np.where(found[near, 1] == near, found[near, 0], found[near, 1])
    pairs = np.unique(np.sort(np.column_stack([near, other]), axis=1), axis=0)
    if len(pairs):
        where = np.round(points[pairs[0, 0]], 2).tolist()
        yield (
            f"{len(pairs)} pairs of coincident nodes, the first near {where} mm: the tissue is torn there, because "
            "the elements on both sides do not share them; merge them unless this is intended (in gmsh: Coherence Mesh)"
        )


def _base(mesh: Mesh) -> tuple[np.ndarray, float, float]:
    """The base's mean normal, the height of the mesh and the mean height of the base, both in mm."""
    corners = mesh.points[mesh.boundary("base")]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = areas.sum(axis=0)
    normal = total / max(float(np.linalg.norm(total)), np.finfo(np.float64).tiny)
    level = np.average(corners[:, :, 2].mean(axis=1), weights=np.linalg.norm(areas, axis=1))
    return normal, float(np.ptp(mesh.points[:, 2])), float(level)


def _size(mesh: Mesh) -> str:
    (x, y, z), ml = np.ptp(mesh.points, axis=0), 1e-3 * mesh.volumes.sum()
    return f"the mesh is {z:.3g} mm high and {x:.3g} x {y:.3g} mm across, with {ml:.3g} ml of tissue"
