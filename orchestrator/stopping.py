"""Stopping by hand: SIGINT and SIGTERM end a run between two steps, not in the middle of one."""

import signal
from types import FrameType, TracebackType
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopRequest:
    """While entered, the first signal is only noted (`signal`); a second one does what it would have done.

    An exception raised at any place whatever, as Python's own handler does it, may be lost: what is raised in a
    destructor is printed and forgotten, and in the middle of writing a file it leaves half of one.
    """

    def __init__(self) -> None:
        self.signal: int | None = None
        self._before: dict[int, Any] = {}

    def __bool__(self) -> bool:
        return self.signal is not None

    def __enter__(self) -> "StopRequest":
        try:
            for number in _SIGNALS:
                # Who ignores a signal, as shells do for their background jobs, goes on ignoring it.
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._before[number] = signal.signal(number, self._note)
        # Only the main thread may; elsewhere nobody asks a run to stop by a signal.
        except ValueError:
            self._before.clear()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.signal = number
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()
