"""Tables of comma-separated values over time: `time` in s, then a column for each variable.

The values of an array stand in one cell, in row-major order and separated by blanks, as in the Reference-FMUs.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..quoting import quoted, shortened
from ..untrusted.archive import LARGEST_MEMBER

_TIME = "time"


@dataclass(frozen=True)
class ValueTable:
    """Times in s, shape (rows,), and the cells of the other columns by their names."""

    times: NDArray[np.float64]
    columns: Mapping[str, Sequence[str]]


def read_values(content: bytes) -> ValueTable:
    """The table in a file's `content`; InputError names the row and the column of what is wrong, not the file."""
    rows = _rows(content)
    if not rows:
        raise InputError(f"it is empty; write a line of names that begins with {_TIME}, and a line for every time")
    names = [cell.strip() for cell in rows[0]]
    if names[0] != _TIME:
        raise InputError(f"its first column is {quoted(names[0])}; it has to be {_TIME}, in s")
    if len(rows) < 2:
        raise InputError("it has names but no values; write a line for every time")
    seen: set[str] = set()
    for name in names:
        if not name or name in seen:
            what = f"'{shortened(name)}' twice" if name else "without a name"
            raise InputError(f"it has a column {what}; give every column a unique name")
        seen.add(name)
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise InputError(f"row {number} has {len(row)} cells, but there are {len(names)} columns")
    cells = dict(zip(names, zip(*rows[1:], strict=True), strict=True))
    return ValueTable(_times(cells.pop(_TIME)), cells)


def _rows(content: bytes) -> list[list[str]]:
    # A field in one cell is longer than what the module takes by itself.
    before = csv.field_size_limit(LARGEST_MEMBER)
    try:
        text = io.StringIO(content.decode("utf-8-sig"), newline="")
        return [row for row in csv.reader(text) if any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"it is not a table of comma-separated values in UTF-8 ({shortened(str(error))})") from None
    finally:
        csv.field_size_limit(before)


def _times(cells: Sequence[str]) -> NDArray[np.float64]:
    times = np.empty(len(cells))
    for place, cell in enumerate(cells):
        try:
            times[place] = float(cell)
        except ValueError:
            times[place] = np.nan
        if not isfinite(times[place]):
            raise InputError(f"row {place + 2}: the time is {quoted(cell)}; expected a finite number, in s")
        if place and times[place] < times[place - 1]:
            raise InputError(
                f"row {place + 2}: the time decreases from {times[place - 1]:.12g} to {times[place]:.12g} s"
            )
    return times
