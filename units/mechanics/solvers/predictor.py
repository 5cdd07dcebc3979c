"""A first guess of the next equilibrium, from the last ones and the loads under which they were.

Equilibria follow the loads, whatever the time between them: the change of the loads is fitted by a combination of their
last changes, and the same combination of the changes of displacement is the guess. No step sizes enter.
"""

from collections.abc import Sequence

import numpy as np

from ...arrays import FloatArray, inner

#: How many changes are remembered; longer spans gain nothing.
MEMORY = 4
#: What is left of a change, relative to it, once the others are taken out of it, below which it is noise.
_NEW = 1e-4


def predicted(
    change: FloatArray, load_changes: Sequence[FloatArray], displacement_changes: Sequence[FloatArray]
) -> FloatArray:
    """The change of displacement for a `change` of the loads, shape (loads,); the latest earlier change comes first."""
    guess = np.zeros_like(displacement_changes[0])
    basis: list[tuple[FloatArray, FloatArray]] = []
    for load, displacement in zip(load_changes, displacement_changes, strict=True):
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
        guess += inner(basis[-1][0], change) * basis[-1][1]
    return guess
