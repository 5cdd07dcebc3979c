"""The limited-memory BFGS method with a preconditioner, such as the stiffness of an earlier deformation.

Source: Nocedal & Wright 2006, algorithm 7.4.
"""

import numpy as np

from ... import kernels
from ...arrays import FloatArray, inner
from .factorisation import Solve

#: Pairs that are remembered; more gain nothing.
_MEMORY = 6


class LimitedMemory:
    """The inverse of a changing stiffness, by what the last steps have shown of it; `size` unknowns."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._steps, self._changes = np.zeros((_MEMORY, size)), np.zeros((_MEMORY, size))
        self._curvature, self._alpha = np.zeros(_MEMORY), np.zeros(_MEMORY)
        self._count, self._next = 0, 0
        self._compiled = kernels.variant() is not None
        if self._compiled:
            self._before = kernels.kernel("quasi_newton_before", integers=4, pointers=5)
            self._after = kernels.kernel("quasi_newton_after", integers=4, pointers=5)
            arrays = self._steps, self._changes, self._curvature, self._alpha
            self._addresses = tuple(map(kernels.address, arrays))

    def forget(self) -> None:
        """Begin anew, with another preconditioner or elsewhere."""
        self._count, self._next = 0, 0

    def remember(self, step: FloatArray, change: FloatArray) -> None:
        """That a `step` has changed the residual by `change`; without curvature along it, it tells nothing."""
        curvature = inner(step, change)
        if not curvature > 0.0:
            return
        self._steps[self._next], self._changes[self._next] = step, change
        self._curvature[self._next] = curvature
        self._next = (self._next + 1) % _MEMORY
        self._count = min(self._count + 1, _MEMORY)

    def step(self, residual: FloatArray, solve: Solve) -> FloatArray:
        """The step that is to bring the `residual` to zero, with the preconditioner `solve`."""
        direction = -residual
        if self._compiled:
            given = self._size, _MEMORY, self._count, self._next
            self._before(*given, *self._addresses, kernels.address(direction))
            direction = np.ascontiguousarray(solve(direction))
            self._after(*given, *self._addresses, kernels.address(direction))
            return direction
        rows = [(self._next - back) % _MEMORY for back in range(1, self._count + 1)]
        for row in rows:
            self._alpha[row] = inner(self._steps[row], direction) / self._curvature[row]
            direction -= self._alpha[row] * self._changes[row]
        direction = solve(direction)
        for row in reversed(rows):
            beta = inner(self._changes[row], direction) / self._curvature[row]
            direction = direction + (self._alpha[row] - beta) * self._steps[row]
        return direction
