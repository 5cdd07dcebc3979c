"""The figures of a run, drawn by a process of their own: it gets ready while the run goes on, beside it.

Importing the plotting library takes as long as half of a heartbeat, and nothing in the run needs it.
"""

import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from .coupling.exchange import Exchange
from .coupling.master import Accepted


class Drawing:
    """While entered, a process waits to draw the figures of the results in `folder`; it never outlives this one.

    As an observer, next to that which writes the results, it draws what does not change as soon as that is there.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "Drawing":
        # Without -P, a file of a library's name in the folder that we are in would be taken for that library.
        command = [sys.executable, "-P", "-m", f"{__package__}.results.figures", str(self._folder), str(os.getpid())]
        # That there is none is said when it is to answer, and keeps nothing from the run.
        with suppress(OSError):
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            # What it was not told any more.
            with suppress(BrokenPipeError):
                process.communicate()

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        if step.number == 0:
            self._tell("begun")

    def begin(self) -> None:
        """Draw the figures of the run that is done; to be waited for by `finish`."""
        self._tell("done")

    def finish(self) -> tuple[str, ...]:
        """Wait for the figures; warnings of what could not be drawn."""
        process = self._process
        line = "" if process is None or process.stdout is None else process.stdout.readline()
        if not line:
            return ("the figures are not drawn: the process that draws them is gone; all other results are complete",)
        answer = json.loads(line)
        if "bug" in answer:
            raise RuntimeError(f"the figures cannot be drawn:\n{answer['bug']}")
        if "refused" not in answer:
            return ()
        what = f"{answer['place']}: {answer['refused']}"
        return (f"the figures cannot be drawn: {what}; all other results are complete",)

    def _tell(self, word: str) -> None:
        # If it has ended, that is said when it is to answer.
        with suppress(BrokenPipeError):
            if self._process is not None and self._process.stdin is not None:
                self._process.stdin.write(f"{word}\n")
                self._process.stdin.flush()
