"""Who is at work, on a board that outlives the process: when that ends inside foreign code, the line says whose.

Nobody reads the board unless the process is watched (`supervision`); then it is memory that two processes share.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from mmap import mmap

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


@contextmanager
def doing(text: str) -> Iterator[None]:
    """While the `with` block lasts, `text` says who is at work, and at what."""
    if _board is None:
        yield
        return
    _board.write(text)
    try:
        yield
    finally:
        _board.write("")
