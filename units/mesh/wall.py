"""Which surfaces bound the wall of the heart in a mesh, told by the names of its boundaries.

A mesh is both ventricles if it has `rv_endocardium` or `rv_septum`, a left ventricle if it has `lv_endocardium`, and a
piece of wall if it has an `endocardium` only; without any of them it is a left ventricle whose boundary is missed. A
boundary that its anatomy has and the mesh lacks is missed by name when it is used.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import IntArray
from ..errors import InvalidInput, listed
from .cavity import checked_rim, rim_of
from .faces import row_keys
from .simplices import Mesh


@dataclass(frozen=True)
class Wall:
    """Names of the inner and outer surfaces of the wall, and the surfaces around each cavity.

    The septum's right side counts as outer for fibres, and belongs to the right cavity (docs/model.md, Geometry).
    """

    endocardium: tuple[str, ...]
    epicardium: tuple[str, ...]
    cavities: Mapping[str, tuple[str, ...]]

    @property
    def boundaries(self) -> tuple[str, ...]:
        """All of its surfaces."""
        return ("base", *self.endocardium, *self.epicardium)


_PIECE = Wall(("endocardium",), ("epicardium",), {})
_LEFT_VENTRICLE = Wall(("lv_endocardium",), ("epicardium",), {"lv_volume": ("lv_endocardium",)})
_BOTH_VENTRICLES = Wall(
    ("lv_endocardium", "rv_endocardium"),
    ("epicardium", "rv_septum"),
    {"lv_volume": ("lv_endocardium",), "rv_volume": ("rv_endocardium", "rv_septum")},
)
#: How much farther than the free wall, to the nearest node of the left cavity, what is no septum lies: a septum is at
#: two thirds of it, and on the coarsest meshes a few per cent say nothing.
_FARTHER = 1.25

_RIGHT = {"rv_endocardium", "rv_septum"}


def wall_of(mesh: Mesh) -> Wall:
    """The anatomy of `mesh`.

    Raises
    ------
    InvalidInput
        Where its boundaries are no partition of the surface: a face in two of them, or, unless it is a piece of wall,
        in none; where an `endocardium` hides a cavity, or a cavity is none.
    """
    have = set(mesh.boundaries)
    if _RIGHT & have:
        wall = _BOTH_VENTRICLES
    elif "endocardium" in have and "lv_endocardium" not in have:
        wall = _PIECE
    else:
        wall = _LEFT_VENTRICLE
    names = tuple(name for name in wall.boundaries if name in have)
    faces = _numbered(mesh)
    _check_disjoint(faces, names)
    if wall is _PIECE:
        _check_open(mesh)
        return wall
    if "endocardium" in have:
        _check_union(faces, wall)
    if {*wall.endocardium, *wall.epicardium} <= have:
        _check_complete(mesh, faces, wall, names)
        for surfaces in wall.cavities.values():
            checked_rim(mesh, surfaces)
    return wall


def wall_warnings(mesh: Mesh) -> list[str]:
    """What is unusual of the boundaries of a mesh that has an anatomy, and may be meant."""
    warnings = []
    have = set(mesh.boundaries)
    if "endocardium" in have and {"lv_endocardium", *_RIGHT} & have:
        warnings.append("the boundary 'endocardium' repeats faces of others and is not used")
    if {"lv_endocardium", *_RIGHT} <= have:
        warnings += _septum_warnings(mesh)
    return warnings


def _numbered(mesh: Mesh) -> dict[str, IntArray]:
    """A number for each face of each boundary, equal for equal faces; and of the whole surface, by an empty name."""
    parts = {"": mesh.surface, **mesh.boundaries}
    keys = row_keys(np.concatenate(list(parts.values())), mesh.nodes)
    return dict(zip(parts, np.split(keys, np.cumsum([len(part) for part in parts.values()])[:-1]), strict=True))


def _check_disjoint(faces: Mapping[str, IntArray], names: tuple[str, ...]) -> None:
    for one, other in combinations(names, 2):
        common = len(np.intersect1d(faces[one], faces[other]))
        if common:
            raise InvalidInput(
                f"{common} faces are in two boundaries, '{one}' ({len(faces[one])} faces) and '{other}' "
                f"({len(faces[other])} faces); leave each in one of them"
            )


def _check_open(mesh: Mesh) -> None:
    """The inner side of a piece of wall ends at its cut sides; one that ends at the base only is a cavity's wall."""
    inner = mesh.boundary("endocardium")
    rim = rim_of(inner)
    if "base" in mesh.boundaries and not len(np.setdiff1d(rim, mesh.boundary_nodes("base"))):
        raise InvalidInput(
            f"the boundary 'endocardium' ({len(inner)} faces) encloses a cavity, open at most at 'base' "
            f"({len(mesh.boundary('base'))} faces), whose volume would be taken as 0; name it 'lv_endocardium', or, "
            "with two ventricles, name its parts 'lv_endocardium', 'rv_endocardium' and 'rv_septum' "
            "(scene: {boundaries: {lv_endocardium: endocardium}})"
        )


def _check_union(faces: Mapping[str, IntArray], wall: Wall) -> None:
    """An `endocardium` beside the cavities' own surfaces may repeat their faces, and is not used then."""
    own = [name for name in (*wall.endocardium, "rv_septum") if name in faces]
    others = np.setdiff1d(faces["endocardium"], np.concatenate([faces[name] for name in own]))
    if len(others):
        counted = " or ".join(f"'{name}' ({len(faces[name])} faces)" for name in own)
        raise InvalidInput(
            f"{len(others)} of {len(faces['endocardium'])} faces of the boundary 'endocardium' are not in {counted}, "
            "and a cavity behind them would have no volume; name them 'lv_endocardium', 'rv_endocardium' or 'rv_septum'"
        )


def _septum_warnings(mesh: Mesh) -> list[str]:
    """The right cavity's volume does not depend on which of its sides is the septum, but the fibres do."""
    # By nodes and by centres of faces: on a coarse mesh the nearest node is far from what it is near to.
    faces = mesh.boundary("lv_endocardium")
    left = cKDTree(np.vstack([mesh.points[np.unique(faces)], mesh.points[faces].mean(axis=1)]))
    septum, free = (
        left.query(mesh.points[mesh.boundary(name)].mean(axis=1))[0].mean() for name in ("rv_septum", "rv_endocardium")
    )
    if septum <= _FARTHER * free:
        return []
    return [
        f"'rv_septum' lies farther from the left cavity than 'rv_endocardium' ({septum:.3g} and {free:.3g} mm on "
        "average): the fibres are wrong if these names are exchanged"
    ]


def _check_complete(mesh: Mesh, faces: Mapping[str, IntArray], wall: Wall, names: tuple[str, ...]) -> None:
    """Every face of the surface is in one of the anatomy's boundaries."""
    left = np.setdiff1d(faces[""], np.concatenate([faces[name] for name in names]))
    if not len(left):
        return
    held = {name: len(np.intersect1d(left, faces[name])) for name in mesh.boundaries if name not in names}
    groups = [f"{count} in '{name}'" for name, count in held.items() if count]
    where = f" ({listed(groups)})" if groups else ""
    missing = [name for name in wall.boundaries if name not in names]
    if wall is _LEFT_VENTRICLE:
        missing += sorted(_RIGHT)
    lacks = f"; the mesh has no boundary named {' or '.join(map(repr, missing))}" if missing else ""
    most = max(held, key=lambda name: held[name], default="")
    remedy = (
        f"scene: {{boundaries: {{epicardium: [epicardium, {most}]}}}} joins two groups"
        if where
        else "name that part of the surface by a physical group, or by scene.boundaries"
    )
    raise InvalidInput(
        f"{len(left)} of {len(faces[''])} faces of the surface are in none of {', '.join(names)}{where}{lacks}; give "
        f"each to one of the boundaries: {remedy}"
    )
