"""Input signals from a CSV file: a column of times, and a column for every input that it drives.

A continuous Real runs linearly from one time to the next, anything else holds its last value; before the first time and
after the last, each is what it is there. Where two rows have one time the signal jumps: the second row holds from then
on.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .fmu_variables import WHOLE
from .participant import Port, Values

_MS_PER_S = 1000.0

#: The names that a column of times can have, with how many of its units make a second.
_TIMES = {"time_ms": _MS_PER_S, "time": 1.0}

#: Bytes of a file that is read as a whole.
_LARGEST = 512 * 2**20

#: How far a time may be from one of the file and still be taken for that, relative to the step.
_SAME = 1e-6

#: Digits and sign of a whole number; one of more is out of every type's range all the same.
_MOST_DIGITS = 25

_Value = TypeVar("_Value")

_BOOLEANS = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}


@dataclass(frozen=True)
class Table:
    """A file as it was read: times in s, which do not decrease, and the cells of its columns by their names."""

    times: NDArray[np.float64]
    columns: Mapping[str, Sequence[str]]


def read_table(path: Path) -> Table:
    """The CSV file at `path`; InputError names the line and the column of what is wrong, not the file."""
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"it has more than {_LARGEST // 2**20} MiB; leave out what is not needed")
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except FileNotFoundError:
        raise InputError("no such file") from None
    except IsADirectoryError:
        raise InputError("this is a folder; give a CSV file") from None
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"it is not a CSV file in UTF-8 ({error})") from None
    if len(rows) < 2:
        raise InputError("it has no values; write a line of names that begins with time_ms, and a line for every time")
    names = [cell.strip() for cell in rows[0]]
    if names[0] not in _TIMES:
        raise InputError(f"the first column is '{names[0][:80]}'; it has to be time_ms, or time, in s")
    for name in names:
        if not name or names.count(name) > 1:
            what = f"'{name[:80]}' occurs twice" if name else "without a name"
            raise InputError(f"there is a column {what}; give every column a unique name")
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise InputError(f"row {line} has {len(row)} cells, but there are {len(names)} columns")
    cells = dict(zip(names, zip(*rows[1:], strict=True), strict=True))
    times = _numbers(names[0], cells.pop(names[0])) / _TIMES[names[0]]
    for line, (one, other) in enumerate(pairwise(times), start=3):
        if other < one:
            raise InputError(f"row {line}: the time decreases from {one:.12g} to {other:.12g} s; sort the rows")
    for line, (one, _, other) in enumerate(zip(times, times[1:], times[2:], strict=False), start=4):
        if one == other:
            raise InputError(f"row {line}: three rows have the time {one:.12g} s; write a jump as two rows")
    return Table(times, cells)


class Signal:
    """What drives one input: the cells of a column in the type of `port`. InputError for those that are none of it."""

    def __init__(self, table: Table, column: str, port: Port) -> None:
        self._times = table.times
        self._port = port
        self._values = _parsed(column, table.columns[column], port)
        self._linear = port.is_real and not port.discrete and not port.fixed

    def at(self, time: float, size: float, before: bool = False) -> Values:
        """The value at `time` (s), or right `before` it, for a step of `size`, in the shape of the port."""
        # A step's end is as good as a row's time: a jump there is not to be missed by rounding.
        near = int(np.searchsorted(self._times, time - _SAME * size))
        if near < len(self._times) and self._times[near] <= time + _SAME * size:
            time = float(self._times[near])
        # The last row that is not after the time; of two at one time the second, unless the value before is asked for.
        place = int(np.searchsorted(self._times, time, side="left" if before else "right")) - 1
        if place < 0:
            return self._shaped(self._values[0])
        if place == len(self._times) - 1 or not self._linear:
            return self._shaped(self._values[place])
        begin, end = self._times[place], self._times[place + 1]
        part = (time - begin) / (end - begin)
        return self._shaped((1.0 - part) * self._values[place] + part * self._values[place + 1])

    @property
    def is_constant(self) -> bool:
        """Whether it is the same at all times."""
        return bool((self._values == self._values[0]).all())

    @property
    def is_continuous(self) -> bool:
        """Whether it can change at any time."""
        return self._linear

    def _shaped(self, value: Values) -> Values:
        return np.asarray(value).reshape(self._port.shape)


def _parsed(column: str, cells: Sequence[str], port: Port) -> Values:
    if port.type == "String":
        return np.array(cells, dtype=np.str_)
    if port.type == "Boolean":
        return np.array([_cell(column, row, cell, _BOOLEANS.get) for row, cell in enumerate(cells, start=2)])
    numbers = _numbers(column, cells)
    if port.is_real:
        return numbers
    least, above = WHOLE[port.type]

    def whole(text: str) -> int | None:
        number = _whole(text)
        return number if least <= number < above and (not port.items or number in port.items) else None

    exact = [_cell(column, row, cell, whole) for row, cell in enumerate(cells, start=2)]
    return np.array(exact, dtype=np.uint64 if port.type == "UInt64" else np.int64)


def _numbers(column: str, cells: Sequence[str]) -> NDArray[np.float64]:
    return np.array([_cell(column, row, cell, _finite) for row, cell in enumerate(cells, start=2)])


def _cell(column: str, row: int, cell: str, parse: Callable[[str], _Value | None]) -> _Value:
    try:
        # Python would read 1_000.
        value = None if "_" in cell else parse(cell.strip().lower())
    except (ValueError, OverflowError):
        value = None
    if value is None:
        raise InputError(f"column '{column}', row {row}: '{cell[:80]}' is not a valid value of the input")
    return value


def _finite(text: str) -> float | None:
    value = float(text)
    return value if isfinite(value) else None


def _whole(text: str) -> int:
    """A whole number, perhaps written as 2.0; ValueError for any other."""
    if text.lstrip("+-").isdecimal():
        # No type holds more digits.
        return int(text[:_MOST_DIGITS])
    if not float(text).is_integer():
        raise ValueError
    return int(float(text))
