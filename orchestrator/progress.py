"""How far something long is: a bar on a terminal, and elsewhere a line for every tenth.

The bar gives up what matters less where the terminal is narrow, and itself last. The remaining time is what the rest
would take at the speed so far. Where nobody looks, as in a pipe or a log file, what is done within two seconds is done
without a word.
"""

import logging
import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar as Bar
from rich.table import Table
from rich.text import Text

from .coupling.exchange import Exchange
from .coupling.master import Accepted

_LOG = logging.getLogger(__name__)

#: Letters that the bar has at least, if possible, and at most.
_SHORTEST, _LONGEST = 10, 40

#: How many lines tell of the whole, and for how many seconds none does: a first estimate comes then.
_PARTS, _SILENCE_S = 10, 2.0

#: How often the bar is drawn, per second.
_PER_SECOND = 5


class Progress:
    """While entered, shows how much of `total` is done, to whoever looks at `console`."""

    def __init__(self, console: Console, title: str, total: float, done: float = 0.0) -> None:
        self._console = console
        self._title = title
        self._total = total
        self._done = done
        self._words: Sequence[str] = ()
        self._begun = time.monotonic()
        # What was done before is not counted: it says nothing of the speed.
        self._first: tuple[float, float] | None = None
        self._told = -1
        # A terminal that cannot go back to the begin of a line gets lines, too.
        is_animated = console.is_terminal and not console.is_dumb_terminal and not console.quiet
        live = Live(get_renderable=self._row, console=console, refresh_per_second=_PER_SECOND)
        self._live = live if is_animated else None

    def update(self, done: float, *words: str) -> None:
        """So much is done now; `words` say it to a person, the most important first."""
        self._done, self._words = done, words
        if self._first is None:
            self._first = time.monotonic(), done
        if self._live is None:
            self._tell()

    def __enter__(self) -> "Progress":
        self._begun = time.monotonic()
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    @property
    def times(self) -> str:
        """The time that has elapsed, and that which remains if anything is known of it, in words."""
        remaining = self._remaining_s
        elapsed = f"elapsed {clock(time.monotonic() - self._begun)}"
        return elapsed if remaining is None or self._done >= self._total else f"{elapsed}, remaining {clock(remaining)}"

    # --- inside -------------------------------------------------------------------------------------------------------

    @property
    def _remaining_s(self) -> float | None:
        """At the speed since the first update; None while nothing is known of it."""
        if self._first is None or self._done <= self._first[1]:
            return None
        begun, before = self._first
        return (time.monotonic() - begun) / (self._done - before) * (self._total - self._done)

    @property
    def _share(self) -> float:
        return self._done / self._total if self._total else 1.0

    def _row(self) -> RenderableType:
        return bar_row(self._title, self._words, self._share, self.times, self._console.width)

    def _tell(self) -> None:
        """A line, if a tenth more is done, or if nothing was said yet."""
        part = int(_PARTS * self._share + 1e-9)
        if part <= self._told or self._remaining_s is None or time.monotonic() - self._begun < _SILENCE_S:
            return
        self._told = part
        percent = int(100.0 * self._share + 1e-9)
        where = f" ({', '.join(self._words[:1])})" if self._words else ""
        self._console.print(
            f"{self._title}: {percent} %{where}, {self.times}", markup=False, highlight=False, soft_wrap=True
        )


class RunProgress:
    """The progress of a run in simulated time, as an observer of its steps."""

    def __init__(self, console: Console, name: str, stop_ms: float) -> None:
        self._stop_ms = stop_ms
        self._progress = Progress(console, name, stop_ms)

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        sweeps = step.sweeps.iterations if step.number else "-"
        where = f"{step.time_ms:g} of {self._stop_ms:g} ms"
        self._progress.update(step.time_ms, where, f"step {step.number}, sweeps {sweeps}")
        if step.is_output:
            _LOG.info("%s, step %s, sweeps %s, %s", where, step.number, sweeps, self._progress.times)

    def __enter__(self) -> "RunProgress":
        self._progress.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.__exit__(kind, error, trace)


def bar_row(title: str, words: Sequence[str], share: float, times: str, width: int) -> Table:
    """Title, first words, bar, further words and times, as far as they fit into `width` letters.

    Of times that do not fit the last one is kept, that which remains.
    """
    first, further = Text("".join(words[:1])), Text(", ".join(words[1:]))
    fits = len(times) < width - _SHORTEST
    heading, clocks = Text(title, style="bold"), Text(times if fits else times.rpartition(", ")[2])
    # The most important first.
    kept: list[Text] = []
    free = width - _SHORTEST
    for text in (clocks, first, heading, further):
        if text.cell_len and text.cell_len + 1 <= free:
            kept.append(text)
            free -= text.cell_len + 1
    length = min(free + _SHORTEST, _LONGEST)
    row = Table.grid(padding=(0, 1, 0, 0), pad_edge=False)
    bar = Bar(total=1.0, completed=share, width=length)
    cells = [cell for cell in (heading, first, bar, further, clocks) if cell is bar or cell in kept]
    for _ in cells:
        row.add_column(no_wrap=True)
    row.add_row(*cells)
    return row


def clock(seconds: float) -> str:
    """`0:07`, `12:40` or `1:02:03`: minutes and seconds, with hours where there are such."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
