"""The reference results of an experiment: the values that a variable has at their times, and how far others are off."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..participants.participant import Port, Values
from ..quoting import quoted, shortened
from .outcome import Comparison, Verdict
from .table import ValueTable, read_values
from .unverified import Unverified

_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


def read_results(content: bytes, name: str) -> ValueTable:
    """The table of results in the file `name`; Unverified if they are none, or if their times do not increase."""
    try:
        table = read_values(content)
    except InputError as error:
        raise Unverified(f"the results in {name} cannot be read: {error}") from None
    if not table.columns:
        raise Unverified(f"the results in {name} have only times and no variable")
    repeated = np.flatnonzero(np.diff(table.times) <= 0.0)
    if repeated.size:
        raise Unverified(
            f"the results in {name} have the time {table.times[repeated[0]]:.12g} s twice, before and after an event; "
            "this master sees only the values after it"
        )
    return table


@dataclass(frozen=True)
class Expected:
    """The values of the variable that `port` stands for at the times of the results, of shape (times, values)."""

    port: Port
    values: NDArray[Any]

    @classmethod
    def of(cls, column: str, cells: Sequence[str], port: Port) -> "Expected":
        """From the cells of a column; Unverified for what the variable cannot be, and for what is no finite number."""
        name = shortened(column)
        rows = [[cell] if not port.shape else cell.split() for cell in cells]
        parsed = []
        for number, row in enumerate(rows, start=2):
            if len(row) != port.size:
                raise Unverified(
                    f"the results have {len(row)} values of '{name}' in row {number}, but the FMU has {port.size}"
                )
            values = [_parsed(cell, port) for cell in row]
            if None in values:
                wrong = row[values.index(None)]
                raise Unverified(
                    f"the results have {quoted(wrong)} for '{name}' in row {number}, which is not a value of "
                    f"type {port.type}"
                )
            parsed.append(values)
        # Whole numbers of 64 bits are exact as objects only.
        return cls(port, np.array(parsed, dtype=np.float64 if port.is_real else object))

    def compared(self, times: NDArray[np.float64], found: Sequence[Values], tolerance: float) -> Comparison:
        """The verdict on the values `found` at the `times` of the results.

        A real number may deviate by `tolerance` times the largest magnitude that the results of the variable have, or
        times 1, FMI's usual nominal value, where they are zero throughout. All else has to be the same.
        """
        actual = [np.asarray(values).reshape(-1).tolist() for values in found]
        if self.port.is_real:
            allowed = tolerance * (float(np.abs(self.values).max()) or 1.0)
            distances = np.abs(np.array(actual, dtype=np.float64) - self.values)
        else:
            allowed = 0.0
            distances = np.array(
                [list(map(_distance, ours, theirs)) for ours, theirs in zip(actual, self.values.tolist(), strict=True)]
            )
        # What is no number is farther off than any.
        distances = np.where(np.isfinite(distances), distances, inf).max(axis=1)
        where = int(distances.argmax())
        deviation = float(distances[where])
        verdict = Verdict.WITHIN if deviation <= allowed else Verdict.DEVIATES
        return Comparison(self.port.name, verdict, deviation, float(times[where]), allowed)


def _parsed(cell: str, port: Port) -> Any:
    """The value that stands in a `cell`; None where it is none that the type can have."""
    if port.type == "String":
        return cell
    text = cell.strip().lower()
    if port.type == "Boolean":
        return _BOOLEANS.get(text)
    try:
        # Python would read 1_000.
        number = float(text.replace("_", "?"))
        if port.is_real:
            return number if np.isfinite(number) else None
        return int(text) if text.lstrip("+-").isdecimal() else (int(number) if number.is_integer() else None)
    except (ValueError, OverflowError):
        return None


def _distance(ours: Any, theirs: Any) -> float:
    if ours == theirs:
        return 0.0
    is_number = isinstance(theirs, int) and not isinstance(theirs, bool)
    return float(abs(int(ours) - theirs)) if is_number else inf
