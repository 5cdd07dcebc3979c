"""Wall-clock and CPU time by who used it."""

import time
from collections import defaultdict
from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple


@dataclass(frozen=True)
class Usage:
    """Seconds of the clock and of the CPU that a call took, told by whoever did it; `apart` from this process or not.

    CPU time is that of the thread that did it.
    """

    wall_s: float
    cpu_s: float
    apart: bool = False


class Moment(NamedTuple):
    """What the clock and the CPU time of this thread show."""

    wall_s: float
    cpu_s: float

    @classmethod
    def now(cls) -> "Moment":
        """Both of them now."""
        # The clock is read outside of the other, whose reading may take a while where processes share a core.
        wall_s = time.perf_counter()
        return cls(wall_s, time.thread_time())

    def used(self, apart: bool = False) -> Usage:
        """What this thread has used since."""
        cpu_s = time.thread_time() - self.cpu_s
        return Usage(time.perf_counter() - self.wall_s, cpu_s, apart)


class Span(NamedTuple):
    """`label` was busy with `what` from `begin`, a time of the process's clock, for `seconds`."""

    label: str
    what: str
    begin: float
    seconds: float


class Stopwatch:
    """Seconds spent, by label: in all (`total`), and as spans since the last `lap`.

    `cpu` is the CPU time by label, as far as it was charged, and `cpu_apart` what of it other processes used.
    """

    def __init__(self) -> None:
        self.total: defaultdict[str, float] = defaultdict(float)
        self.cpu: defaultdict[str, float] = defaultdict(float)
        self.cpu_apart = 0.0
        self._spans: list[Span] = []

    def measure(self, label: str, what: str) -> "Measured":
        """Add the time of the `with` block to `label`."""
        return Measured(self, label, what)

    def add(self, label: str, what: str, begin: float, seconds: float) -> None:
        """Add a span that was measured elsewhere."""
        self.total[label] += seconds
        self._spans.append(Span(label, what, begin, seconds))

    def charge(self, label: str, usage: Usage) -> None:
        """Add the CPU time of `usage` to that of `label`."""
        self.cpu[label] += usage.cpu_s
        if usage.apart:
            self.cpu_apart += usage.cpu_s

    def lap(self) -> tuple[Span, ...]:
        """The spans since the last call."""
        spans = tuple(self._spans)
        self._spans.clear()
        return spans


class Measured:
    """See `Stopwatch.measure`."""

    __slots__ = ("_begin", "_label", "_watch", "_what")

    def __init__(self, watch: Stopwatch, label: str, what: str) -> None:
        self._watch, self._label, self._what = watch, label, what

    def __enter__(self) -> None:
        self._begin = time.perf_counter()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._watch.add(self._label, self._what, self._begin, time.perf_counter() - self._begin)


def seconds_by_label(spans: tuple[Span, ...]) -> dict[str, float]:
    """The sum of the spans of each label."""
    total: defaultdict[str, float] = defaultdict(float)
    for span in spans:
        total[span.label] += span.seconds
    return dict(total)
