"""The log messages of FMUs, each brought to the participant it belongs to."""

from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import byref
from typing import Any
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

#: fmi2Status from which a message tells of a failure, and from which it may tell why one came about.
_ERROR, _WARNING = 3, 1


class FmuLog:
    """The errors that one FMU has logged since the last `clear`; `reasons` are what it warned of, or discards by."""

    def __init__(self) -> None:
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
        """What is logged in here is not what the call failed by: a question that an FMU need not answer."""
        before = list(self.errors), list(self.reasons), self.blames_input
        try:
            yield
        finally:
            self.errors, self.reasons, self.blames_input = before

    def hear(self, status: int, category: bytes, message: bytes) -> None:
        """Take a message; errors are kept until the call that caused them returns."""
        if status >= _ERROR:
            self.errors.append(message.decode("utf-8", errors="replace"))
            self.blames_input = category == INVALID_INPUT.encode()
        elif status >= _WARNING:
            self.reasons.append(message.decode("utf-8", errors="replace"))

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
        self.callbacks.logger = _LOGGER
        self.callbacks.componentEnvironment = id(self)
        _LOGS[id(self)] = self
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        if formats:
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


# One function for all FMUs: FMPy's proxy, which fills in printf arguments, keeps only the one it was given last.
_LOGGER = fmi2CallbackLoggerTYPE(_route)
