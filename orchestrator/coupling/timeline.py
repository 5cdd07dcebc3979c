"""Simulated time, counted in whole ticks: no step is lost to round-off and every output time is hit exactly."""

from dataclasses import dataclass
from math import ceil


@dataclass(frozen=True)
class Timeline:
    """The time axis of a run.

    `tick_ms` is the shortest possible step; the run ends after `stop` ticks and fields are kept every `every` ticks,
    which are `every_ms` together.
    """

    tick_ms: float
    stop: int
    every: int
    every_ms: float

    @classmethod
    def of_fixed_step(cls, step_ms: float, stop_ms: float, every_ms: float) -> "Timeline":
        """A tick is a communication step; both times are whole numbers of it."""
        return cls(step_ms, round(stop_ms / step_ms), round(every_ms / step_ms), every_ms)

    @classmethod
    def of_shortest_step(cls, min_ms: float, stop_ms: float, every_ms: float, fineness: int = 8) -> "Timeline":
        """Ticks of at most a `fineness`-th of the shortest step, a whole number of them between two outputs."""
        every = ceil(every_ms / min_ms * fineness)
        return cls(every_ms / every, round(stop_ms / every_ms) * every, every, every_ms)

    def time_ms(self, tick: int) -> float:
        """The time at `tick`; at output times free of what the ticks between them would add up to."""
        outputs, rest = divmod(tick, self.every)
        return outputs * self.every_ms + rest * self.tick_ms

    def size_ms(self, ticks: int) -> float:
        """The length of so many ticks."""
        return ticks * self.tick_ms

    def is_output(self, tick: int) -> bool:
        """Whether the fields are kept at `tick`."""
        return tick % self.every == 0

    def next_event(self, tick: int) -> int:
        """Ticks from `tick` to the next output or to the end, whichever comes first."""
        return min(self.every - tick % self.every, self.stop - tick)
