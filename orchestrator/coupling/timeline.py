"""Simulated time, counted in whole ticks: no step is lost to round-off and every output time is hit exactly.

Times are computed as fractions of the decimals that the scenario has, and rounded once: three steps of 0.7 ms end at
2.1 ms, which the sum of their floating-point numbers does not.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil, lcm


@dataclass(frozen=True)
class Timeline:
    """The time axis of a run.

    `tick` is the shortest possible step in ms; the run ends after `stop` ticks, at the time `end`, and fields are kept
    every `every` ticks, which are `period` together.
    """

    tick: Fraction
    stop: int
    end: Fraction
    every: int
    period: Fraction

    @classmethod
    def of_fixed_step(cls, step_ms: float, stop_ms: float, every_ms: float) -> "Timeline":
        """A tick is a communication step; both times are whole numbers of it."""
        step, stop, every = _decimal(step_ms), _decimal(stop_ms), _decimal(every_ms)
        return cls(step, round(stop / step), stop, round(every / step), every)

    @classmethod
    def of_shortest_step(cls, min_ms: float, stop_ms: float, every_ms: float, fineness: int = 8) -> "Timeline":
        """Ticks of at most a `fineness`-th of the shortest step, a whole number of them between two outputs."""
        every = ceil(every_ms / min_ms * fineness)
        period, stop = _decimal(every_ms), _decimal(stop_ms)
        return cls(period / every, round(stop / period) * every, stop, every, period)

    @cached_property
    def _whole(self) -> tuple[int, int, int, int]:
        """`tick`, `end` and `period` as whole numbers of one unit, and how many units are 1 ms.

        The quotient of two whole numbers is rounded correctly, and quickly.
        """
        units = lcm(self.tick.denominator, self.end.denominator, self.period.denominator)
        return int(self.tick * units), int(self.end * units), int(self.period * units), units

    @property
    def tick_ms(self) -> float:
        """The shortest possible step."""
        return float(self.tick)

    def time_ms(self, tick: int) -> float:
        """The time at `tick`; at output times and at the end free of what the ticks before would add up to."""
        step, end, period, units = self._whole
        if tick == self.stop:
            return end / units
        outputs, rest = divmod(tick, self.every)
        return (outputs * period + rest * step) / units

    def size_ms(self, ticks: int) -> float:
        """The length of so many ticks."""
        step, _, _, units = self._whole
        return ticks * step / units

    def is_output(self, tick: int) -> bool:
        """Whether the fields are kept at `tick`."""
        return tick % self.every == 0

    def next_event(self, tick: int) -> int:
        """Ticks from `tick` to the next output or to the end, whichever comes first."""
        return min(self.every - tick % self.every, self.stop - tick)


def _decimal(number: float) -> Fraction:
    """What a floating-point number was written as: the shortest decimal that is read as it."""
    return Fraction(repr(float(number)))
