"""The section `scene` of a scenario: the anatomy and its mesh."""

from typing import Annotated, Any

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from .section import Section
from .values import FilePath, Positive

#: Nested refinements of a mesh: six make a quarter of a million tetrahedra of each.
_MOST_LEVELS = 6

#: Characters in the name of a group in a mesh file.
_LONGEST_GROUP = 200

#: The units of length that coordinates in a file may be in, in mm, and the factors that may stand in their place.
_LENGTHS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
_SCALES = (1e-6, 1e6)

_GROUP: dict[str, Any] = {"type": ["string", "integer"]}
_GROUPS: dict[str, Any] = {"anyOf": [_GROUP, {"type": "array", "items": _GROUP, "minItems": 1}]}
_SCALE: dict[str, Any] = {
    "anyOf": [{"enum": [*_LENGTHS_MM, None]}, {"type": "number", "minimum": _SCALES[0], "maximum": _SCALES[1]}]
}


def _groups(value: Any) -> list[str | int]:
    groups = value if isinstance(value, list) else [value]
    if not groups or not all(isinstance(group, str | int) and not isinstance(group, bool) for group in groups):
        raise ValueError("expected the name or the number of a group of triangles in the mesh file, or a list of such")
    if any(isinstance(group, int) and abs(group) >= 2**53 for group in groups):
        raise ValueError("expected numbers of groups as a mesh file has them, not one with so many digits")
    if any(isinstance(group, str) and len(group) > _LONGEST_GROUP for group in groups):
        raise ValueError(f"expected names of groups of at most {_LONGEST_GROUP} characters")
    return groups


def _scale(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if (
        value is not None
        and not (isinstance(value, str) and value in _LENGTHS_MM)
        and not (number and _SCALES[0] <= value <= _SCALES[1])
    ):
        raise ValueError(
            f"expected a unit of length, {', '.join(_LENGTHS_MM)}, or a number from {_SCALES[0]:g} to {_SCALES[1]:g} "
            "that makes mm of the file's coordinates"
        )
    return value


class Scene(Section):
    """The anatomy: either a named geometry, meshed at a given element size, or a mesh file of your own."""

    geometry: str | None = Field(
        default=None,
        description="The name of an anatomy that comes with the project. Give either `geometry` or `mesh`.",
    )
    mesh: FilePath | None = Field(
        default=None,
        description="The path of a mesh file, relative to the scenario file: tetrahedra in a format that gmsh or "
        "meshio reads, or an .npz file that this project wrote. Give either `mesh` or `geometry`.",
    )
    mesh_size_mm: Positive = Field(
        default=5.0,
        description="The element size at which a `geometry` is meshed, in mm. It has no meaning with `mesh`.",
    )
    refine: Annotated[int, Field(ge=0, le=_MOST_LEVELS)] = Field(
        default=0,
        description="How many times the mesh is refined uniformly. Every level halves the element size, so that it "
        "gives eight times as many tetrahedra.",
    )
    boundaries: dict[str, Annotated[Any, AfterValidator(_groups), WithJsonSchema(_GROUPS)]] = Field(
        default_factory=dict,
        description="Which groups of triangles in the mesh file make up which boundary: the name of a boundary (such "
        "as `base` or `lv_endocardium`), and the name or the number of a group, or a list of them. Boundaries that "
        "are called so in the file already need no entry.",
    )
    scale: Annotated[Any, AfterValidator(_scale), WithJsonSchema(_SCALE)] = Field(
        default=None,
        description="The unit of length of the coordinates in the mesh file (`mm`, `cm` or `m`), or the factor that "
        "converts them to mm. Without it they are taken to be in mm.",
    )

    @model_validator(mode="after")
    def _one_of(self) -> "Scene":
        if (self.geometry is None) == (self.mesh is None):
            raise ValueError("give either `geometry` (with `mesh_size_mm`) or `mesh`, a mesh file")
        if self.mesh is not None and "mesh_size_mm" in self.model_fields_set:
            raise ValueError("`mesh_size_mm` has no meaning with `mesh`; remove it")
        if self.mesh is None and (self.boundaries or self.scale is not None):
            raise ValueError("`boundaries` and `scale` are for the content of a `mesh` file; remove them")
        return self

    @property
    def unit_mm(self) -> float:
        """What the coordinates in the mesh file are multiplied by."""
        return float(_LENGTHS_MM.get(self.scale or "mm", self.scale))
