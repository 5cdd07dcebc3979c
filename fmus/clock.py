"""The time that an instance has reached, and which steps it may take from there."""

from dataclasses import dataclass
from math import inf, isfinite, isnan

from ..units.errors import InvalidInput

#: By how much of a step a host's sums of step sizes may be off: its rounding, not a gap.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Clock:
    """Times in s: where the instance is, and the stop time, infinite if none was given."""

    time: float = 0.0
    stop: float = inf

    def __post_init__(self) -> None:
        if not isfinite(self.time) or isnan(self.stop) or self.stop < self.time:
            raise InvalidInput(
                f"an experiment cannot run from {self.time} s to {self.stop} s: the start has to be finite, and not "
                "after the stop"
            )

    def check(self, time: float, size: float) -> None:
        """InvalidInput for a step that FMI does not allow (FMI 2.0.4, section 4.2.2; FMI 3.0, section 4.2.1).

        Its size has to be finite and above zero, and its begin is where the last one ended: no step goes back, leaves
        a gap or passes the stop time.
        """
        if not (isfinite(time) and isfinite(size) and size > 0.0):
            raise InvalidInput(
                f"a step from {time} s by {size} s is not possible: both have to be finite, the size above 0"
            )
        allowed = _ROUNDING * size
        if abs(time - self.time) > allowed:
            raise InvalidInput(
                f"a step cannot begin at {time:.12g} s: the instance is at {self.time:.12g} s; to repeat a step, "
                "restore a saved state first"
            )
        if time + size > self.stop + allowed:
            raise InvalidInput(
                f"a step from {time:.12g} s by {size:.12g} s passes the stop time of the experiment, {self.stop:.12g} s"
            )
