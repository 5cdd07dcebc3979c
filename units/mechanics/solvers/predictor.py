"""A first guess of the next equilibrium, from the last ones and the loads under which they were.

Equilibria follow the loads, whatever the time between them: the change of the loads is fitted by a combination of their
last changes, and the same combination of the changes of displacement is the guess. No step sizes enter.
"""

import ctypes
from collections.abc import Sequence

import numpy as np

from ... import kernels
from ...arrays import FloatArray, inner

#: How many changes are remembered; longer spans gain nothing.
MEMORY = 4
#: What is left of a change, relative to it, once the others are taken out of it, below which it is noise.
_NEW = 1e-4


class Predictor:
    """Guesses for a solid under `loads` loads, of which those from number `heavy` on count `weight` times as much.

    So the pressure in a cavity weighs as much as the active stress at all nodes.
    """

    def __init__(self, loads: int, heavy: int, weight: float) -> None:
        self._loads, self._heavy, self._weight = loads, heavy, weight
        self._guess = kernels.kernel("predictor_guess", integers=4, pointers=6) if kernels.variant() else None

    def __call__(
        self, change: FloatArray, load_changes: Sequence[FloatArray], displacement_changes: Sequence[FloatArray]
    ) -> FloatArray:
        """The change of displacement for a `change` of the loads, shape (loads,); the latest earlier change is first.

        Changes of displacement have any one shape.
        """
        guess = np.zeros_like(displacement_changes[0])
        if self._guess is None:
            self._add(guess, change, load_changes, displacement_changes)
            return guess
        count = len(load_changes)
        addresses = ctypes.c_void_p * count
        known = addresses(*map(kernels.address, load_changes))
        moved = addresses(*map(kernels.address, displacement_changes))
        work, numbers = np.empty(count * (self._loads + guess.size)), np.array([self._weight, _NEW])
        sizes = self._loads, guess.size, count, self._heavy
        self._guess(*sizes, known, moved, *map(kernels.address, (change, numbers, work, guess)))
        return guess

    def _add(
        self,
        guess: FloatArray,
        change: FloatArray,
        load_changes: Sequence[FloatArray],
        displacement_changes: Sequence[FloatArray],
    ) -> None:
        weights = np.where(np.arange(self._loads) < self._heavy, 1.0, self._weight)
        basis: list[tuple[FloatArray, FloatArray]] = []
        for load, displacement in zip(load_changes, displacement_changes, strict=True):
            load = weights * load
            before = np.sqrt(inner(load, load))
            if not before > 0.0:
                continue
            # Loads are made orthogonal, and displacements, which follow linearly in the small, are taken along.
            for known, moved in basis:
                part = inner(known, load)
                load, displacement = load - part * known, displacement - part * moved
            left = np.sqrt(inner(load, load))
            if left < _NEW * before:
                continue
            basis.append((load / left, displacement / left))
            guess += inner(basis[-1][0], weights * change) * basis[-1][1]
