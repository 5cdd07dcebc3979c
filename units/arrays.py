"""The array types that units exchange and keep."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def frozen(values: ArrayLike) -> FloatArray:
    """A read-only float64 copy of `values`.

    States and exchanged fields are never changed in place: saving one is then keeping a reference.
    """
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def inner(left: FloatArray, right: FloatArray) -> float:
    """The inner product of vectors, shape (n,). Unlike that of BLAS, its bits do not depend on the number of threads."""
    return float(np.einsum("i,i->", left, right))
