"""What an experiment gives to the inputs of the FMU, from its table of stimuli.

A continuous real number runs linearly from one row to the next, anything else holds its last value; before the first
row and after the last, each is what it is there; where two rows have one time the second holds from then on. The
standard leaves this open; it is how the Reference-FMUs' own simulator reads its input files.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError, did_you_mean
from ..participants.participant import Port, Ports, Values
from ..participants.signals import Signal, Table
from ..quoting import shortened
from .table import ValueTable


class Stimulus:
    """What one input, or an element of one, is given: the cells of its column as values of its `port`."""

    def __init__(self, table: ValueTable, column: str, port: Port) -> None:
        self.name = column
        self._shape = port.shape
        columns = [table.columns[column]] if not port.shape else _split(column, table.columns[column], port)
        scalar = replace(port, shape=())
        self._signals = [Signal(Table(table.times, {column: cells}), column, scalar) for cells in columns]
        self.is_constant = all(signal.is_constant for signal in self._signals)

    def at(self, time: float, step: float) -> Values:
        """Its value at `time` (s), of the port's shape, for a communication step of `step`."""
        return np.array([signal.at(time, step) for signal in self._signals]).reshape(self._shape)


def stimuli(table: ValueTable, inputs: Ports) -> list[Stimulus]:
    """What the columns of `table` give to `inputs`; InputError for a column that is none of them, or does not fit."""
    for column in table.columns:
        if not inputs.known(column):
            raise InputError(f"the FMU has no input '{shortened(column)}'{did_you_mean(column, inputs)}")
    return [Stimulus(table, column, inputs[column]) for column in table.columns]


def _split(column: str, cells: Sequence[str], port: Port) -> list[tuple[str, ...]]:
    """The columns of an array's elements, from the column of the whole."""
    rows = [cell.split() for cell in cells]
    for number, row in enumerate(rows, start=2):
        if len(row) != port.size:
            raise InputError(
                f"column '{shortened(column)}', row {number}: {len(row)} values, but the input has {port.size}"
            )
    return list(zip(*rows, strict=True))
