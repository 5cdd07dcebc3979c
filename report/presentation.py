"""What a run is looked at by, made by a process of its own: it gets ready while the run goes on, beside it.

Importing the plotting libraries takes as long as half of a heartbeat, and nothing in the run needs them.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from ..orchestrator.coupling.exchange import Exchange
from ..orchestrator.coupling.master import Accepted

#: What is made, in the order in which it is, by the names that the other process knows it by.
FIGURES, PAGE = "figures", "report"


class Presentation:
    """While entered, a process waits to present the results in `folder`; it never outlives this one. See run.Companion.

    Parameters
    ----------
    name, settings:
        The scenario's name and what was changed of its file: what is drawn before there is a summary says so too.
    parts:
        Which of FIGURES and PAGE are made.
    """

    def __init__(
        self,
        folder: Path,
        name: str = "",
        settings: Mapping[str, Any] | None = None,
        parts: tuple[str, ...] = (FIGURES, PAGE),
    ) -> None:
        self._folder = folder
        self._parts = parts
        self._heading = {"name": name, "settings": dict(settings or {})}
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "Presentation":
        arguments = [str(self._folder), str(os.getpid()), *self._parts]
        # Without -P, a file of a library's name in the folder that we are in would be taken for that library.
        command = [sys.executable, "-P", "-m", __package__, *arguments]
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
            self._tell(f"begun {json.dumps(self._heading)}")

    def begin(self) -> None:
        """See Companion."""
        self._tell("done")

    def finish(self) -> tuple[str, ...]:
        """See Companion."""
        process = self._process
        line = "" if process is None or process.stdout is None else process.stdout.readline()
        what = " and ".join(f"the {part}" for part in self._parts)
        if not line:
            return (f"{what} could not be made: the process that makes them ended; all other results are complete",)
        answer = json.loads(line)
        if "bug" in answer:
            raise RuntimeError(f"{what} could not be made:\n{answer['bug']}")
        if "refused" not in answer:
            return ()
        return (f"{what} could not be written: {answer['place']}: {answer['refused']}; all other results are complete",)

    def _tell(self, line: str) -> None:
        # If it has ended, that is said when it is to answer.
        with suppress(BrokenPipeError):
            if self._process is not None and self._process.stdin is not None:
                self._process.stdin.write(f"{line}\n")
                self._process.stdin.flush()
