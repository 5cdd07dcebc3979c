"""Which surfaces bound the wall of the heart in a mesh, told by the names of its boundaries.

A mesh is a piece of wall if it has an `endocardium`, both ventricles if it has `rv_endocardium` or `rv_septum`, and
else a left ventricle. A boundary that its anatomy has and the mesh lacks is missed by name when it is used.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import InvalidInput
from .simplices import Mesh


@dataclass(frozen=True)
class Wall:
    """Names of the inner and outer surfaces of the wall, and the surfaces around each cavity.

    The septum's right side counts as outer for fibres, and belongs to the right cavity (model.md, Geometry).
    """

    endocardium: tuple[str, ...]
    epicardium: tuple[str, ...]
    cavities: Mapping[str, tuple[str, ...]]


_PIECE = Wall(("endocardium",), ("epicardium",), {})
_LEFT_VENTRICLE = Wall(("lv_endocardium",), ("epicardium",), {"lv_volume": ("lv_endocardium",)})
_BOTH_VENTRICLES = Wall(
    ("lv_endocardium", "rv_endocardium"),
    ("epicardium", "rv_septum"),
    {"lv_volume": ("lv_endocardium",), "rv_volume": ("rv_endocardium", "rv_septum")},
)


def wall_of(mesh: Mesh) -> Wall:
    """The anatomy of `mesh`.

    Raises
    ------
    InvalidInput
        Where a left ventricle has other faces than its own, which may be those of a right one.
    """
    if "endocardium" in mesh.boundaries:
        wall = _PIECE
    elif {"rv_endocardium", "rv_septum"} & set(mesh.boundaries):
        wall = _BOTH_VENTRICLES
    else:
        wall = _LEFT_VENTRICLE
    if wall is _LEFT_VENTRICLE and {*wall.endocardium, *wall.epicardium} <= set(mesh.boundaries):
        own = ("base", *wall.endocardium, *wall.epicardium)
        others = len(mesh.surface) - sum(len(mesh.boundaries[name]) for name in own if name in mesh.boundaries)
        if others:
            raise InvalidInput(
                f"the mesh has no boundary named 'rv_endocardium' or 'rv_septum', and {others} faces of its surface "
                f"are none of {', '.join(own)}; name those of the right ventricle so, or, where there is none, give "
                "all faces to these three"
            )
    return wall
