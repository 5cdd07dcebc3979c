"""A CSV file that is complete up to its last row at every moment."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .appended import AppendedFile


class Table:
    """Rows under fixed columns, written through at once. Numbers keep all their digits; None leaves a cell empty.

    With `resumed`, the `memory` of an earlier process, the file goes on after the rows of that; what it had beyond
    them is removed.
    """

    def __init__(self, path: Path, columns: Sequence[str], resumed: Mapping[str, Any] | None = None) -> None:
        self._file = AppendedFile(path, resumed)
        if resumed is None:
            self._file.append(csv_line(columns))

    def add(self, row: Sequence[float | int | str | None]) -> None:
        """Append a row and hand it to the operating system."""
        self._file.append(csv_line([_cell(value) for value in row]))

    def rows(self) -> list[list[str]]:
        """The cells of all rows."""
        return list(csv.reader(io.StringIO(self._file.content().decode(), newline="")))[1:]

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return self._file.memory()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def csv_line(cells: Sequence[Any]) -> bytes:
    """A line of a CSV file; numbers with all their digits."""
    text = io.StringIO(newline="")
    csv.writer(text).writerow(cells)
    return text.getvalue().encode()


def _cell(value: float | int | str | None) -> str:
    if type(value) is float or type(value) is int:
        return repr(value)
    if value is None or isinstance(value, str):
        return value or ""
    # `item` makes plain numbers of NumPy's, whose repr is no number.
    return repr(np.asarray(value).item())
