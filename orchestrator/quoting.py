"""Content of a file as a message quotes it: short and on one line, whatever the content is."""

from collections.abc import Mapping, Set
from typing import Any

#: Characters of a value that a message repeats.
_LONGEST = 80

#: Digits of a whole number that are worth reading; Python refuses to write more than 4300.
_MOST_DIGITS = 40

_EMPTY = {list: "[]", tuple: "()", dict: "{}", set: "set()"}


def quoted(value: Any) -> str:
    """`value` as Python writes it, shortened; collections of collections by their size alone."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**_MOST_DIGITS:
        # Counted by its bits, for the digits themselves take time that grows with their square.
        return f"a number of about {int(value.bit_length() * 0.30103) + 1} digits"
    if isinstance(value, (bytes, bytearray)):
        return f"{len(value)} bytes"
    if isinstance(value, str):
        return shortened(repr(value[: 2 * _LONGEST]))
    if isinstance(value, Mapping):
        return _collection(value, "{", "}", [f"{_item(key)}: {_item(item)}" for key, item in _first(value.items())])
    if isinstance(value, (list, tuple, Set)):
        return _collection(value, "[", "]", [_item(item) for item in _first(value)])
    return shortened(repr(value))


def shortened(text: str, longest: int = _LONGEST) -> str:
    """`text` on one line, without control characters, and cut where it becomes too long."""
    plain = "".join(letter if letter.isprintable() else " " for letter in text[: longest + 1])
    return plain if len(text) <= longest else f"{plain[:longest]}..."


def _first(items: Any) -> list[Any]:
    return [item for item, _ in zip(items, range(_LONGEST), strict=False)]


def _item(value: Any) -> str:
    if isinstance(value, (Mapping, list, tuple, Set)):
        return "..." if value else _EMPTY.get(type(value), "{}")
    return quoted(value)


def _collection(value: Any, begin: str, end: str, items: list[str]) -> str:
    return shortened(f"{begin}{', '.join(items)}{end}" if len(value) <= _LONGEST else f"{begin}{', '.join(items)}")
