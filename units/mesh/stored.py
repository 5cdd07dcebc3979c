"""What a mesh file holds, whatever its format: tetrahedra, triangles, and what the file says of the triangles."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import FloatArray, IntArray

#: Cells of other kinds than these hold tissue or its surface in a form that linear tetrahedra cannot take.
READ = ("vertex", "line", "triangle", "tetra")


class UnreadableMesh(Exception):
    """A file that is not what its format has it to be; the message says what is wrong in it."""


@dataclass(frozen=True)
class StoredMesh:
    """The content of a mesh file, not judged yet.

    Parameters
    ----------
    points:
        Coordinates in the file's unit of length, shape (nodes, 3).
    tetrahedra, triangles:
        Node numbers, shapes (elements, 4) and (faces, 3); −1 stands for a node that the file does not have.
    others:
        How many cells of each other kind there are.
    named:
        For each group of triangles that has a name, which of them are in it.
    numbered:
        For each array of whole numbers on the triangles, by its name, which of them bear each number.
    notes:
        What is worth knowing of the file, in sentences for a person.
    """

    points: FloatArray
    tetrahedra: IntArray
    triangles: IntArray
    others: Mapping[str, int] = field(default_factory=dict)
    named: Mapping[str, IntArray] = field(default_factory=dict)
    numbered: Mapping[str, Mapping[int, IntArray]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def by_number(values: IntArray) -> dict[int, IntArray]:
    """Where each number stands in `values`, shape (faces,)."""
    order = np.argsort(values, kind="stable")
    different, begins = np.unique(values[order], return_index=True)
    return dict(zip(different.tolist(), np.split(order, begins[1:]), strict=True))
