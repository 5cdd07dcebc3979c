"""The progress bar: simulated time, steps, sweeps of the last step, and the estimated end."""

from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from .coupling.exchange import Exchange
from .coupling.master import Accepted


class ProgressBar:
    """Shows a run on the terminal; silent where there is none."""

    def __init__(self, console: Console, name: str, stop_ms: float) -> None:
        self._progress = Progress(
            TextColumn(f"[bold]{name}"),
            TextColumn("{task.fields[time_ms]:g}" + f" of {stop_ms:g} ms"),
            BarColumn(),
            TextColumn("step {task.fields[number]}, sweeps {task.fields[iterations]}"),
            TimeElapsedColumn(),
            TextColumn("ends in"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task(name, total=stop_ms, time_ms=0.0, number=0, iterations="-")

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        iterations = step.sweeps.iterations if step.number else "-"
        self._progress.update(
            self._task, completed=step.time_ms, time_ms=step.time_ms, number=step.number, iterations=iterations
        )

    def __enter__(self) -> "ProgressBar":
        # Where there is no terminal, even stopping a disabled bar would print an empty line.
        if not self._progress.disable:
            self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._progress.disable:
            self._progress.stop()
