"""The tissue in compiled kernels (`kernels/solid.h`): the same as `bulk`, to rounding, some twenty times as fast."""

import ctypes

import numpy as np

from .. import kernels
from ..arrays import FloatArray
from .bulk import Bulk, NumpyBulk, Tissue
from .elements.space import Space
from .kinematics import VOIGT_COLUMNS, VOIGT_ROWS
from .stiffness import StiffnessPattern

#: Points in a block, and constants of a law: LANES and LAW_PARAMETERS in C.
_LANES, _CONSTANTS = 16, 8


class _Solid(ctypes.Structure):
    """`struct solid` of kernels/solid.h."""

    _fields_ = (
        ("blocks", ctypes.c_int64),
        ("element_nodes", ctypes.c_int64),
        ("nodes", ctypes.c_void_p),
        ("gradients", ctypes.c_void_p),
        ("weights", ctypes.c_void_p),
        ("fiber", ctypes.c_void_p),
        ("sheet", ctypes.c_void_p),
        ("active", ctypes.c_void_p),
        ("vertex_shares", ctypes.c_void_p),
        ("laws", ctypes.c_int64),
        ("law", ctypes.c_void_p),
        ("law_parameters", ctypes.c_void_p),
    )


def bulk(space: Space, tissue: Tissue, pattern: StiffnessPattern) -> Bulk:
    """The tissue in compiled kernels, or in NumPy where there are none, or none of one of its laws."""
    numbers = [kernels.law_number(law.name) for law in tissue.laws]
    if kernels.variant() is None or min(numbers) < 0:
        return NumpyBulk(space, tissue, pattern)
    return CompiledBulk(space, tissue, pattern, numbers)


class CompiledBulk:
    """See Bulk."""

    def __init__(self, space: Space, tissue: Tissue, pattern: StiffnessPattern, laws: list[int]) -> None:
        self._elements, points = space.weights.shape
        count = self._elements * points
        # What the last block lacks is filled up with the last point, at no weight.
        blocks = -(-count // _LANES)
        source = np.minimum(np.arange(blocks * _LANES), count - 1)
        element = source // points

        def blocked(values: np.ndarray, kind: type = np.float64) -> np.ndarray:
            """From (padded points, ...) to (blocks, ..., lanes)."""
            split: np.ndarray = np.asarray(values, dtype=kind).reshape(blocks, _LANES, *values.shape[1:])
            return np.ascontiguousarray(np.moveaxis(split, 1, -1))

        weights = space.weights.ravel()[source]
        weights[count:] = 0.0
        constants = np.zeros((len(laws), _CONSTANTS))
        for row, law in zip(constants, tissue.laws, strict=True):
            given = law.constants()
            row[: len(given)] = given
        # Kept, for C knows where they lie only.
        self._arrays = {
            "nodes": blocked(space.nodes[element], np.int32),
            "gradients": blocked(space.gradients.reshape(count, -1, 3)[source]),
            "weights": blocked(weights),
            "fiber": blocked(tissue.fiber[element]),
            "sheet": blocked(tissue.sheet[element]),
            "active": blocked(tissue.active_tensor[:, VOIGT_ROWS, VOIGT_COLUMNS][element]),
            "law": np.array(laws, dtype=np.int32),
            "law_parameters": constants,
        }
        if points > 1:
            self._arrays["vertex_shares"] = blocked(np.tile(space.vertex_shares, (self._elements, 1))[source])
        # Without a weight, what fills up adds zeros to the blocks of the last element.
        self._slots = blocked(pattern.slots[element], np.int32)
        addresses = {name: kernels.address(array) for name, array in self._arrays.items()}
        self._solid = _Solid(blocks=blocks, element_nodes=space.nodes.shape[1], laws=len(laws), **addresses)
        self._reference = ctypes.byref(self._solid)
        self._blocks, self._nodes, self._points = pattern.blocks, len(space.points), count
        self._vertices = int(space.nodes[:, :4].max()) + 1
        self._forces = kernels.kernel("solid_forces", pointers=6)
        self._tangent = kernels.kernel("solid_tangent", pointers=5)
        self._stretch = kernels.kernel("solid_stretch_squared", pointers=3)
        self._energy, self._smallest = np.zeros(1), np.zeros(1)

    def forces(
        self, displacement: FloatArray, tension: FloatArray, with_energy: bool
    ) -> tuple[float, FloatArray] | None:
        """See Bulk."""
        given, force = self._given(displacement, tension), np.zeros((self._nodes, 3))
        energy = kernels.address(self._energy) if with_energy else None
        force_at, smallest = kernels.address(force), kernels.address(self._smallest)
        if not self._forces(self._reference, *given, energy, force_at, smallest):
            return None
        return (float(self._energy[0]) if with_energy else 0.0), force

    def stiffness(self, displacement: FloatArray, tension: FloatArray) -> FloatArray:
        """See Bulk."""
        blocks = np.zeros((self._blocks, 3, 3))
        given = self._given(displacement, tension)
        self._tangent(self._reference, *given, kernels.address(self._slots), kernels.address(blocks))
        return blocks

    def stretch(self, displacement: FloatArray) -> FloatArray:
        """See Bulk."""
        squared = np.empty(int(self._solid.blocks) * _LANES)
        self._stretch(self._reference, self._given(displacement)[0], kernels.address(squared))
        stretch = np.sqrt(squared[: self._points])
        return stretch if self._points == self._elements else stretch.reshape(self._elements, -1).mean(axis=1)

    def _given(self, displacement: FloatArray, tension: FloatArray | None = None) -> tuple[int, ...]:
        """Addresses of what C reads; TypeError for arrays that are not as it takes them to be."""
        if displacement.shape != (self._nodes, 3) or not _plain(displacement):
            raise TypeError(f"displacements of the shape {displacement.shape}, expected {(self._nodes, 3)}")
        if tension is None:
            return (kernels.address(displacement),)
        if tension.ndim != 1 or len(tension) < self._vertices or not _plain(tension):
            raise TypeError(f"tension of the shape {tension.shape}, expected {(self._vertices,)}")
        return kernels.address(displacement), kernels.address(tension)


def _plain(array: np.ndarray) -> bool:
    return array.dtype == np.float64 and array.flags.c_contiguous
