"""Anderson's acceleration, known in coupling as IQN-ILS (Walker & Ni 2011; Degroote et al. 2009).

The differences of the residuals so far are combined by least squares to cancel the present residual, and the same
combination of the differences of H is taken. Columns that are nearly dependent on newer ones are filtered out, for
they make the combination arbitrary; columns of earlier steps in time can be kept, which mostly saves the first guesses.
"""

from collections import deque

import numpy as np
from scipy.linalg import solve_triangular

from ...participants.participant import Values


class Anderson:
    """Least squares on up to `columns` differences, from this step and the `reused_steps` before it.

    Parameters
    ----------
    initial:
        Relaxation while there are no differences yet.
    columns, reused_steps:
        Limits of the memory. None of earlier steps by default: on a heart whose wave moves on they saved two of
        fifty-five sweeps under Gauss–Seidel and cost twenty of a hundred and thirty under Jacobi.
    filter_limit:
        A column goes whose part independent of the newer ones is smaller than this fraction of its length.
    """

    def __init__(self, initial: float, columns: int = 100, reused_steps: int = 0, filter_limit: float = 1e-2) -> None:
        self._initial = initial
        self._columns = columns
        self._limit = filter_limit
        # Newest first; one entry per step in time, each a list of (difference of residuals, difference of H).
        self._memory: deque[list[tuple[Values, Values]]] = deque(maxlen=reused_steps + 1)
        self.begin()

    def begin(self) -> None:
        """See Acceleration."""
        if not self._memory or self._memory[0]:
            self._memory.appendleft([])
        self._before: tuple[Values, Values] | None = None

    def forget(self) -> None:
        """See Acceleration."""
        self._memory.clear()
        self.begin()

    def next(self, iterate: Values, residual: Values) -> Values:
        """See Acceleration."""
        image = iterate + residual
        if self._before is not None:
            change = residual - self._before[0]
            if np.any(change):
                self._memory[0].insert(0, (change, image - self._before[1]))
        self._before = (np.array(residual), image)
        pairs = [pair for step in self._memory for pair in step][: self._columns]
        factors, triangle, kept = self._orthogonal([change for change, _ in pairs])
        if not kept:
            return iterate + self._initial * residual
        weights = solve_triangular(triangle, factors.T @ -residual)
        return image + np.stack([pairs[column][1] for column in kept], axis=1) @ weights

    def _orthogonal(self, columns: list[Values]) -> tuple[Values, Values, list[int]]:
        """QR factors of the columns that are independent enough of the newer ones, and which those are."""
        basis: list[Values] = []
        rows: list[Values] = []
        kept: list[int] = []
        for number, candidate in enumerate(columns):
            length = np.linalg.norm(candidate)
            rest, projections = candidate, np.zeros(len(basis))
            # Twice is enough: once more removes what rounding left of the first pass.
            for _ in range(2):
                for place, vector in enumerate(basis):
                    part = float(vector @ rest)
                    rest = rest - part * vector
                    projections[place] += part
            remaining = np.linalg.norm(rest)
            if remaining <= self._limit * length or len(basis) == len(candidate):
                continue
            basis.append(rest / remaining)
            rows.append(np.append(projections, remaining))
            kept.append(number)
        triangle = np.zeros((len(kept), len(kept)))
        for column, row in enumerate(rows):
            triangle[: len(row), column] = row
        return np.stack(basis, axis=1) if basis else np.empty((0, 0)), triangle, kept
