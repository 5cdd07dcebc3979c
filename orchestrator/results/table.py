"""A CSV file that is complete up to its last row at every moment."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .writing import writing


class Table:
    """Rows under fixed columns, written through at once. Numbers keep all their digits; None leaves a cell empty.

    With `kept` the file goes on after so many rows of an earlier run; what it had beyond them is removed.
    """

    def __init__(self, path: Path, columns: Sequence[str], kept: int | None = None) -> None:
        self.rows = kept or 0
        with writing(path):
            if kept is None:
                self._file = path.open("w", newline="", encoding="utf-8")
            else:
                self._file = path.open("r+", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)
        if kept is None:
            self._writer.writerow(columns)
        else:
            for _ in range(kept + 1):
                self._file.readline()
            self._file.seek(self._file.tell())
            self._file.truncate()

    def add(self, row: Sequence[float | int | None]) -> None:
        """Append a row and hand it to the operating system."""
        # `item` makes plain numbers of NumPy's, whose repr is no number.
        self._writer.writerow(["" if value is None else repr(np.asarray(value).item()) for value in row])
        self._file.flush()
        self.rows += 1

    def close(self) -> None:
        """Close the file."""
        self._file.close()
