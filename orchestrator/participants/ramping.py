"""Ramps of participants that ramp by themselves, from the values of their last step to those set (`input_ramp`).

A step of length zero tells such a participant where the ramp begins: what a value was at a step's begin need not be
what was foretold for the end of the step before.
"""

from collections.abc import Callable

from .participant import Ramp, Values


class PendingRamps:
    """The ramps of the next step, until it starts."""

    def __init__(self) -> None:
        self._ramps: dict[str, Ramp] = {}

    def add(self, name: str, ramp: Ramp) -> None:
        """Keep the ramp of the input `name` for the next step."""
        self._ramps[name] = ramp

    def apply(self, assign: Callable[[str, Values], None], settle: Callable[[], None]) -> None:
        """Before a step: `assign` the begins, `settle` them by a step of length zero, and `assign` the ends."""
        ramps, self._ramps = self._ramps, {}
        if not ramps:
            return
        for name, ramp in ramps.items():
            assign(name, ramp.begin)
        settle()
        for name, ramp in ramps.items():
            assign(name, ramp.end)
