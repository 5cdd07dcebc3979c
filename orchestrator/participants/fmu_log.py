"""The log messages of FMUs, each brought to the participant it belongs to."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from ctypes import CFUNCTYPE, byref, c_char_p, c_int, c_void_p, cast
from pathlib import Path
from typing import Any, BinaryIO
from weakref import WeakValueDictionary

from fmpy.fmi2 import (
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.logging import addLoggerProxy

from ...fmus.messages import INVALID_INPUT
from .printf import argument_types, can_read_arguments, filled

#: fmi2Status from which a message tells of a failure, and from which it may tell why one came about.
_ERROR, _WARNING = 3, 1


#: The names of statuses, in both versions of FMI.
_STATUSES = ("ok", "warning", "discard", "error", "fatal", "pending")


class FmuLog:
    """What one FMU logs, for a file; and the errors among it since the last `clear`.

    `reasons` are what it warned of, or discarded a step by.
    """

    def __init__(self) -> None:
        self.instance = ""
        #: Simulated time of the last step that was begun, in s.
        self.time = 0.0
        self._lines: list[str] = []
        self._path: Path | None = None
        self._file: BinaryIO | None = None
        self.errors: list[str] = []
        self.reasons: list[str] = []
        self.blames_input = False

    def clear(self) -> None:
        """Forget what was logged."""
        self.errors.clear()
        self.reasons.clear()
        self.blames_input = False

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Messages logged inside are not taken for the reason of a failure: an FMU may refuse this call."""
        before = list(self.errors), list(self.reasons), self.blames_input
        try:
            yield
        finally:
            self.errors, self.reasons, self.blames_input = before

    def hear(self, status: int, category: bytes, message: bytes) -> None:
        """Take a message; errors are kept until the call that caused them returns."""
        self._keep(status, category.decode("utf-8", errors="replace"), message.decode("utf-8", errors="replace"))
        if status >= _ERROR:
            self.errors.append(message.decode("utf-8", errors="replace"))
            self.blames_input = category == INVALID_INPUT.encode()
        elif status >= _WARNING:
            self.reasons.append(message.decode("utf-8", errors="replace"))

    def write_to(self, path: Path) -> None:
        """Write all messages to the end of the file at `path` from now on, and those there have been."""
        self._path = path
        lines, self._lines = self._lines, []
        for line in lines:
            self._write(line)

    def close(self) -> None:
        """Close the file, if there is one."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _keep(self, status: int, category: str, message: str) -> None:
        label = _STATUSES[status] if 0 <= status < len(_STATUSES) else str(status)
        # A message of several lines is one entry: the others are indented.
        text = message.rstrip().replace("\r", "").replace("\n", "\n\t")
        self._write(f"{self.time:.12g} s\t{self.instance}\t{label}\t{category}\t{text}\n")

    def _write(self, line: str) -> None:
        if self._path is None:
            self._lines.append(line)
            return
        # Made only when there is something to write, and written through at once: a crash loses nothing. That the disk
        # is full does not concern the FMU that calls here, and what it computes is not harmed by it.
        with suppress(OSError):
            if self._file is None:
                self._file = self._path.open("ab", buffering=0)
            self._file.write(line.encode("utf-8", errors="replace"))

    def __str__(self) -> str:
        return "; ".join(self.errors or self.reasons)


class Fmi2Log(FmuLog):
    """The same with the callbacks through which an FMI 2.0 FMU logs.

    Parameters
    ----------
    formats:
        Whether messages are printf formats, as FMI 2.0 has it. PythonFMU never gives arguments and its users' messages
        are no formats: a percent sign in one would make the reader of formats end the process.
    """

    def __init__(self, formats: bool) -> None:
        super().__init__()
        self._formats = formats
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = cast(_FORMATTER if formats else _LOGGER, fmi2CallbackLoggerTYPE)
        self.callbacks.componentEnvironment = id(self)
        _LOGS[id(self)] = self
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        if formats and not can_read_arguments():
            addLoggerProxy(byref(self.callbacks))

    def hear(self, status: int, category: bytes, message: bytes) -> None:
        """See FmuLog."""
        super().hear(status, category, message if self._formats else message.replace(b"%%", b"%"))


#: The log of each FMI 2.0 FMU, by the address given to it as component environment.
_LOGS: WeakValueDictionary[int, Fmi2Log] = WeakValueDictionary()


def _route(environment: int | None, instance: bytes, status: int, category: bytes, message: bytes) -> Any:
    log = _LOGS.get(environment or 0)
    if log is not None:
        log.hear(status, category or b"", message or b"")


def _route_format(
    environment: int | None, instance: bytes, status: int, category: bytes, message: bytes, *arguments: float
) -> Any:
    _route(environment, instance, status, category, filled(message or b"", arguments))


# One function for all FMUs: FMPy's proxy, which fills in printf arguments, keeps only the one it was given last.
_LOGGER = fmi2CallbackLoggerTYPE(_route)
_FORMATTER: Any = _LOGGER
if can_read_arguments():
    _FORMATTER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, *argument_types())(_route_format)
