"""Constant relaxation: x ← x + ω r."""

from ...participants.participant import Values


class Relaxation:
    """Takes the fraction `factor` of every residual; 1 is the plain iteration.

    A scalar linear loop of gain g converges for 0 < ω < 2/(1 − g), fastest at 1/(1 − g).
    """

    def __init__(self, factor: float) -> None:
        self._factor = factor

    def begin(self) -> None:
        """See Acceleration; nothing is remembered."""

    def forget(self) -> None:
        """See Acceleration; nothing is remembered."""

    def next(self, iterate: Values, residual: Values) -> Values:
        """See Acceleration."""
        return iterate + self._factor * residual
