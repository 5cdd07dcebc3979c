"""timeseries.csv: scalars and probes after every accepted step."""

from collections.abc import Mapping
from math import isnan, nan
from pathlib import Path
from typing import Any

from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from ..participants.participant import Participant
from ..probes import Probes
from .names import TIME_SERIES
from .table import Table


class TimeSeries:
    """A row for the initial state and for every accepted step; the columns follow from the outputs' `record`.

    Cells of units that did not step in an exchange are empty (NaN in `rows`).

    `columns` and `rows` hold what was written. `resumed` is the `memory` of an earlier run in the same folder.
    """

    def __init__(
        self,
        folder: Path,
        participants: Mapping[str, Participant],
        probes: Probes | None,
        resumed: Mapping[str, Any] | None = None,
    ) -> None:
        self._probes = probes
        self._recorded = [
            (unit, port)
            for unit, participant in participants.items()
            for port in participant.outputs.values()
            if port.record != "nothing"
        ]
        # Probed fields first, then scalars, then those that are drawn from a field.
        self._recorded.sort(key=lambda item: (item[1].record != "probes", item[1].of is not None))
        self.columns = ["time_ms"]
        for unit, port in self._recorded:
            names = ["time_ms", *(other.column for _, other in self._recorded)]
            taken = names.count(port.column) > 1
            name, suffix = port.name, port.column.removeprefix(port.name)
            stem = f"{unit}.{name}" if taken else name
            if port.record == "probes":
                self.columns += [f"{stem}_{probe}{suffix}" for probe in (probes.names if probes else ())]
            else:
                self.columns.append(f"{stem}{suffix}")
        self._table = Table(folder / TIME_SERIES, self.columns, resumed)
        # Numbers come back from their shortest decimals to the last bit.
        self.rows = [[float(cell) if cell else nan for cell in row] for row in self._table.rows()]

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        row = [step.time_ms]
        for unit, port in self._recorded:
            width = len(self._probes.names) if self._probes else 0
            if unit in step.waiting:
                # Not computed at this time: an empty cell, not a value of some time before.
                row += [nan] * (width if port.record == "probes" else 1)
                continue
            values = exchange.value(unit, port.name)
            if port.record == "probes":
                row += self._probes(values) if self._probes else []
            else:
                row.append(float(values))
        self.rows.append(row)
        self._table.add([None if isnan(value) else value for value in row])

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return self._table.memory()

    def column(self, name: str) -> list[float]:
        """All values of a column so far."""
        place = self.columns.index(name)
        return [row[place] for row in self.rows]

    def close(self) -> None:
        """Close the file."""
        self._table.close()
