"""The protocol of accelerations: what the iteration calls."""

from typing import Protocol

from ...participants.participant import Values


class Acceleration(Protocol):
    """Makes the next iterate of x ← H(x) from the present one and its residual H(x) − x.

    All vectors are the concatenated, scaled interface fields, shape (n,). A residual of zero is a possible input.
    """

    def begin(self) -> None:
        """A new step in time starts."""

    def forget(self) -> None:
        """Forget what was learned, because the vectors are scaled differently from here on."""

    def next(self, iterate: Values, residual: Values) -> Values:
        """The iterate that follows `iterate`."""
