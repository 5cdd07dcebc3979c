"""timeseries.csv: scalars and probes after every accepted step."""

from collections import Counter
from collections.abc import Mapping
from itertools import chain
from math import isnan, nan
from pathlib import Path
from typing import Any

from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from ..participants.participant import Participant, Port, Values
from ..participants.recorded import recorded
from ..probes import Probes
from .names import TIME_SERIES
from .table import Table

Cell = float | int | str


class TimeSeries:
    """A row for the initial state and for every accepted step.

    The columns are the variables that the participants were asked to observe, or, if none was, follow from the outputs'
    `record`. Booleans are 0 and 1. Cells of units that did not step in an exchange are empty (NaN in `rows`).

    `columns` and `rows` hold what was written; `texts` are the columns that hold no numbers. `resumed` is the `memory`
    of an earlier run in the same folder.
    """

    def __init__(
        self,
        folder: Path,
        participants: Mapping[str, Participant],
        probes: Probes | None,
        resumed: Mapping[str, Any] | None = None,
    ) -> None:
        self._probes = probes
        self._chosen = any(participant.observed for participant in participants.values())
        ports = recorded(participants)
        self.columns = ["time_ms"]
        self.texts: set[str] = set()
        plain = [self._columns(port) for _, port in ports]
        # Each with the number of its columns.
        self._recorded = [(unit, port, len(own)) for (unit, port), own in zip(ports, plain, strict=True)]
        times = Counter(["time_ms", *chain.from_iterable(plain)])
        for (unit, port), own in zip(ports, plain, strict=True):
            if any(times[name] > 1 for name in own):
                own = [f"{unit}.{name}" for name in own]
            self.columns += own
            if port.type == "String":
                self.texts.update(own)
        self._table = Table(folder / TIME_SERIES, self.columns, resumed)
        # Numbers come back from their shortest decimals to the last bit.
        self.rows: list[list[Cell]] = [
            [self._cell(column, cell) for column, cell in zip(self.columns, row, strict=True)]
            for row in self._table.rows()
        ]

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        row: list[Cell] = [step.time_ms]
        for unit, port, columns in self._recorded:
            if unit in step.waiting:
                # Not computed at this time: an empty cell, not a value of some time before.
                row += [nan] * columns
            else:
                row += self._cells(port, exchange.value(unit, port.name))
        self.rows.append(row)
        self._table.add([None if isinstance(value, float) and isnan(value) else value for value in row])

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return self._table.memory()

    def column(self, name: str) -> list[float]:
        """All values of a column of numbers so far."""
        place = self.columns.index(name)
        return [float(row[place]) for row in self.rows]

    def close(self) -> None:
        """Close the file."""
        self._table.close()

    def _columns(self, port: Port) -> list[str]:
        """The columns of a port, each with its unit of measure."""
        names = port.elements
        if self._is_probed(port):
            names = iter([f"{port.name}_{probe}" for probe in self._probes.names] if self._probes else [])
        return [f"{name}{port.column.removeprefix(port.name)}" for name in names]

    def _is_probed(self, port: Port) -> bool:
        """Whether a field is recorded at the probes; one that was asked for, where there are none, is as a whole."""
        return port.record == "probes" and (not self._chosen or bool(self._probes and self._probes.names))

    def _cells(self, port: Port, values: Values) -> list[Cell]:
        if self._is_probed(port):
            return [*self._probes(values)] if self._probes else []
        cells: list[Cell] = (values.astype(int) if port.type == "Boolean" else values).ravel().tolist()
        return cells

    def _cell(self, column: str, text: str) -> Cell:
        if column in self.texts:
            return text
        return float(text) if text else nan
