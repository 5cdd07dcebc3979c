"""Which faces of a mesh file form which boundary: by the names in the file, or as the scenario assigns them."""

import difflib
from collections.abc import Mapping, Sequence

import numpy as np

from ..arrays import IntArray
from ..errors import InvalidInput, listed
from .stored import StoredMesh

#: The boundaries that the units know.
BOUNDARIES = ("base", "epicardium", "endocardium", "lv_endocardium", "rv_endocardium", "rv_septum")

#: Names or numbers of what makes up each boundary.
Naming = Mapping[str, Sequence[str | int]]

#: Numbers of a file that a message lists, and characters in the name of a group.
_LISTED, _LONGEST = 20, 200


def named_faces(stored: StoredMesh, naming: Naming) -> dict[str, IntArray]:
    """For each boundary which of the triangles are its own.

    Boundaries in `naming` are what that says. All other groups keep the name they have in the file, but for those
    that `naming` has used.

    Raises
    ------
    InvalidInput
        For groups without triangles or with endless names, names and numbers that the file does not have, numbers that
        several arrays have and mean different faces by, and a file without names and `naming`.
    """
    longest = max(map(len, stored.named), default=0)
    if longest > _LONGEST:
        raise InvalidInput(f"has a group with a name of {longest} characters; give it one of at most {_LONGEST}")
    for name in naming:
        if name not in BOUNDARIES:
            near = difflib.get_close_matches(name, BOUNDARIES, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known boundaries: {', '.join(BOUNDARIES)}"
            raise InvalidInput(f"scene.boundaries.{name}: no unit knows a boundary of that name; {hint}")
    used = {group for groups in naming.values() for group in groups}
    told = {name: _gathered(stored, name, groups) for name, groups in naming.items()}
    kept = {name: members for name, members in stored.named.items() if name not in used and name not in told}
    empty = [name for name, members in (kept | told).items() if name in BOUNDARIES and not len(members)]
    if empty:
        raise InvalidInput(
            f"there are no triangles in {', '.join(map(repr, empty))}; save the surface's triangles with their "
            "physical groups (in gmsh: Mesh.SaveAll=0)"
        )
    if not told and not kept:
        raise InvalidInput(f"has no named boundaries; {_remedy(stored)}")
    return kept | told


def _remedy(stored: StoredMesh) -> str:
    if stored.numbered:
        number = min(next(iter(stored.numbered.values())))
        return (
            f"name them by their numbers, as in `scene: {{boundaries: {{base: {number}}}}}`: it has {_numbers(stored)}"
        )
    if len(stored.triangles):
        return "save the surface triangles in physical groups (gmsh's formats do that), or with numbers as cell data"
    return "it has no triangles at all; save those of the surface as well, in physical groups (gmsh's formats do that)"


def _gathered(stored: StoredMesh, boundary: str, groups: Sequence[str | int]) -> IntArray:
    found = []
    for group in groups:
        if isinstance(group, str):
            if group not in stored.named:
                near = difflib.get_close_matches(group, stored.named, n=1)
                hint = f"; did you mean '{near[0]}'?" if near else ""
                raise InvalidInput(
                    f"scene.boundaries.{boundary}: there is no group of triangles named '{group}' "
                    f"(known: {listed(stored.named)}){hint}"
                )
            found.append(stored.named[group])
        else:
            found.append(_with_number(stored, boundary, group, groups))
    # A face that is in two of the groups is in their union once.
    return np.unique(np.concatenate(found)) if len(found) > 1 else found[0]


def _with_number(stored: StoredMesh, boundary: str, number: int, groups: Sequence[str | int]) -> IntArray:
    numbers = {group for group in groups if not isinstance(group, str)}
    holders = {name: members for name, members in stored.numbered.items() if numbers <= set(members)}
    if not holders:
        raise InvalidInput(
            f"scene.boundaries.{boundary}: no array of whole numbers on the triangles holds {sorted(numbers)} "
            f"(known: {_numbers(stored) or 'none'})"
        )
    first, *others = holders
    if any(not np.array_equal(holders[first][number], holders[other][number]) for other in others):
        raise InvalidInput(
            f"scene.boundaries.{boundary}: the number {number} stands for different faces in "
            f"{' and '.join(sorted(map(repr, holders)))}; leave one of these arrays in the file"
        )
    return holders[first][number]


def _numbers(stored: StoredMesh) -> str:
    """The arrays of numbers, for a message."""
    described = []
    for name, members in list(stored.numbered.items())[:_LISTED]:
        numbers = sorted(members)
        dots = ", ..." if len(numbers) > _LISTED else ""
        described.append(f"'{name[:_LONGEST]}': {', '.join(map(str, numbers[:_LISTED]))}{dots}")
    return "; ".join(described)
