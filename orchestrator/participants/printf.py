"""The log messages of FMI 2.0, which are formats of C's printf with arguments, filled in without trusting them.

A format that asks for a text which was not given, a percent sign in a plain message for instance, would make the reader
of C's formats follow a wild pointer and end the process. Here a pointer is followed only where there is memory.
"""

import os
import platform
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from ctypes import c_double, c_uint64
from typing import Any

#: Registers for whole numbers and pointers that are left to the arguments after the five of a logger, by machine
#: (System V ABI, AMD64, section 3.2.3; AAPCS64, section 6.4). The rest of them is on the stack.
_REGISTERS = {"x86_64": 1, "aarch64": 3}

#: Arguments in registers for real numbers, and those on the stack that are looked at.
_REALS, _STACK = 8, 8

_CONVERSION = re.compile(
    rb"%(?P<flags>[-+ #0]*)(?P<width>\*|\d{1,9})?(?:\.(?P<precision>\*|\d{0,9}))?(?P<length>hh|h|ll|l|L|q|j|z|t)?"
    rb"(?P<kind>[diouxXeEfFgGaAcspn%])"
)

_BITS = {b"hh": 8, b"h": 16, None: 32}

#: Characters of a field, and bytes of a text, that are still a message.
_WIDEST, _LONGEST = 1000, 65536

_PAGE = 4096


def can_read_arguments() -> bool:
    """Whether it is known here where a function finds the arguments that its declaration does not name."""
    return sys.platform == "linux" and platform.machine() in _REGISTERS


def argument_types() -> list[Any]:
    """What a callback declares after its own five arguments to get hold of those that follow."""
    whole = _REGISTERS[platform.machine()]
    return [c_uint64] * whole + [c_double] * _REALS + [c_uint64] * _STACK


class _Arguments:
    """The arguments that a callback of `argument_types` got, one after the other."""

    def __init__(self, values: Sequence[float]) -> None:
        registers = _REGISTERS[platform.machine()]
        self._whole = [int(value) for value in values[:registers]]
        self._reals = [float(value) for value in values[registers : registers + _REALS]]
        self._stack = [int(value) for value in values[registers + _REALS :]]

    def whole(self) -> int:
        """The next whole number or pointer."""
        if self._whole:
            return self._whole.pop(0)
        return self._stack.pop(0) if self._stack else 0

    def real(self) -> float:
        """The next real number."""
        if self._reals:
            return self._reals.pop(0)
        # Beyond the registers both kinds lie on the stack, in the order in which they were given.
        return c_double.from_buffer_copy(c_uint64(self._stack.pop(0) if self._stack else 0)).value


def filled(message: bytes, values: Sequence[float]) -> bytes:
    """`message` with the `values` that a callback of `argument_types` got in place of its conversions."""
    arguments = _Arguments(values)
    return _CONVERSION.sub(lambda match: _converted(match, arguments), message)


def _converted(match: re.Match[bytes], arguments: _Arguments) -> bytes:
    kind, length = match["kind"].decode(), match["length"]
    if kind == "%":
        return b"%"
    flags, width = match["flags"].decode(), _size(match["width"], arguments)
    if width < 0:
        flags, width = flags + "-", -width
    precision = None if match["precision"] is None else _size(match["precision"], arguments)
    if kind == "s":
        text = _text(arguments.whole())
        shown = text if precision is None or precision < 0 else text[:precision]
        return shown.ljust(width) if "-" in flags else shown.rjust(width)
    if kind in "pn":
        # Nothing is ever written to where an argument points.
        pointer = arguments.whole()
        return f"0x{pointer:x}".encode() if kind == "p" else b""
    spec = f"%{flags}{width or ''}{'' if precision is None or precision < 0 else f'.{precision}'}"
    if kind == "c":
        return bytes([arguments.whole() & 0xFF])
    if kind in "diouxX":
        bits = _BITS.get(length, 64)
        number = arguments.whole() & (2**bits - 1)
        if kind in "di" and number >= 2 ** (bits - 1):
            number -= 2**bits
        return (f"{spec}{'d' if kind in 'iu' else kind}" % number).encode()
    if length == b"L":
        return match[0]
    value = arguments.real()
    return value.hex().encode() if kind in "aA" else (f"{spec}{kind}" % value).encode()


def _size(given: bytes | None, arguments: _Arguments) -> int:
    if given == b"*":
        size = arguments.whole() & 0xFFFFFFFF
        size -= 2**32 if size >= 2**31 else 0
    else:
        size = int(given or 0)
    return max(-_WIDEST, min(_WIDEST, size))


def _text(pointer: int) -> bytes:
    """The text at `pointer`, up to where it or the memory ends."""
    found = b""
    with suppress(OSError, OverflowError, ValueError), open("/proc/self/mem", "rb", buffering=0) as memory:
        while len(found) < _LONGEST:
            at = pointer + len(found)
            piece = os.pread(memory.fileno(), _PAGE - at % _PAGE, at)
            end = piece.find(b"\0")
            if end >= 0 or not piece:
                return found + piece[: max(end, 0)]
            found += piece
    return found or b"(?)"
