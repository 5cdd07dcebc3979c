"""Aitken's dynamic relaxation (Irons & Tuck 1969): one factor for all fields, from the last two residuals.

It fails, slowly, where components of the error need different factors, as under parallel schemes; Anderson's
method is the better choice there.
"""

import numpy as np

from ...participants.participant import Values


class Aitken:
    """x ← x + ω r, ω_k = −ω_{k−1} r_{k−1}·(r_k − r_{k−1}) / |r_k − r_{k−1}|²; the first ω of a step is `initial`."""

    def __init__(self, initial: float) -> None:
        self._initial = initial
        self.begin()

    def begin(self) -> None:
        """See Acceleration."""
        self._factor = self._initial
        self._before: Values | None = None

    def forget(self) -> None:
        """See Acceleration."""
        self.begin()

    def next(self, iterate: Values, residual: Values) -> Values:
        """See Acceleration. Where the residual does not change at all, the last factor stays."""
        if self._before is not None:
            change = residual - self._before
            length = float(change @ change)
            if length > 0.0:
                self._factor *= -float(self._before @ change) / length
        self._before = np.array(residual)
        return iterate + self._factor * residual
