"""Wall-clock time by who used it."""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Span:
    """`label` was busy with `what` from `begin`, a time of the process's clock, for `seconds`."""

    label: str
    what: str
    begin: float
    seconds: float


class Stopwatch:
    """Seconds spent, by label: in all (`total`), and as spans since the last `lap`."""

    def __init__(self) -> None:
        self.total: defaultdict[str, float] = defaultdict(float)
        self._spans: list[Span] = []

    @contextmanager
    def measure(self, label: str, what: str) -> Iterator[None]:
        """Add the time of the `with` block to `label`."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.add(label, what, begin, time.perf_counter() - begin)

    def add(self, label: str, what: str, begin: float, seconds: float) -> None:
        """Add a span that was measured elsewhere."""
        self.total[label] += seconds
        self._spans.append(Span(label, what, begin, seconds))

    def lap(self) -> tuple[Span, ...]:
        """The spans since the last call."""
        spans = tuple(self._spans)
        self._spans.clear()
        return spans


def seconds_by_label(spans: tuple[Span, ...]) -> dict[str, float]:
    """The sum of the spans of each label."""
    total: defaultdict[str, float] = defaultdict(float)
    for span in spans:
        total[span.label] += span.seconds
    return dict(total)
