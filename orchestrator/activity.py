"""Which unit is working, in memory that outlives the process: if that ends inside an FMU, the message names the FMU.

The board is read only if the process is watched (`supervision`); then it is memory that two processes share.
"""

from mmap import mmap
from types import TracebackType

#: Bytes of the board: whether the process ends of itself, its exit code then, and the text.
SIZE = 512


class Board:
    """One line of text and an exit code, in `memory` of `SIZE` bytes that are zero."""

    def __init__(self, memory: mmap) -> None:
        self._memory = memory

    def write(self, text: str) -> None:
        """Replace the text; what is too long is cut."""
        line = text.encode("utf-8")[: SIZE - 3]
        self._memory[2 : len(line) + 3] = line + b"\0"

    def read(self) -> str:
        """The text."""
        return self._memory[2:].partition(b"\0")[0].decode("utf-8", errors="replace")

    def end(self, code: int) -> None:
        """The process ends of itself, with this exit code."""
        self._memory[0:2] = bytes([1, code & 0xFF])

    @property
    def ended(self) -> int | None:
        """The exit code with which the process ended of itself; None where it did not come to that."""
        return self._memory[1] if self._memory[0] else None


_board: Board | None = None


def show_on(board: Board) -> None:
    """From now on what is done in this process is shown on `board`."""
    global _board
    _board = board


class Doing:
    """See `doing`. Entered at every call of an FMU, where a generator would cost as much as the call."""

    __slots__ = ("_text",)

    def __init__(self, text: str) -> None:
        self._text = text

    def __enter__(self) -> None:
        if _board is not None:
            _board.write(self._text)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if _board is not None:
            _board.write("")


def doing(text: str) -> Doing:
    """While the `with` block lasts, `text` says who is at work, and at what."""
    return Doing(text)
