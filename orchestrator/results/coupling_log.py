"""coupling.csv: how each accepted step went, and what it cost."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..coupling.exchange import Exchange
from ..coupling.master import MASTER, Accepted
from .names import COUPLING
from .table import Table


class CouplingLog:
    """A row per accepted step: step size, sweeps, residuals, rejections and seconds by unit.

    `converged` names the fields that iterated loops exchange ("unit.field"); each has a column with its last residual.
    `contraction_rate` is empty where one sweep measures no rate. `alternating` names the exchanged fields that may
    alternate; each has a column with the factor by which that grows (coupling.growth), 0 where it does not alternate,
    empty where too little is known or the field is not new. Where steps are `adaptive`, `error` is the estimated
    error over the tolerance, empty where there is none, and `tolerance_missed` is 1 where it is above and the step
    could not be any shorter. `resumed` is the `memory` of an earlier run.
    """

    def __init__(
        self,
        folder: Path,
        units: Sequence[str],
        converged: Sequence[str] = (),
        resumed: Mapping[str, Any] | None = None,
        adaptive: bool = False,
        alternating: Sequence[str] = (),
    ) -> None:
        self._units = units
        self._converged = converged
        self._alternating = alternating
        self._adaptive = adaptive
        residuals = [f"residual_{name}" for name in converged]
        seconds = [f"seconds_{unit}" for unit in (*units, MASTER)]
        judged = ["error", "tolerance_missed"] if adaptive else []
        growth = [f"growth_{name}" for name in alternating]
        first = ["time_ms", "step_ms", "iterations", *residuals, "contraction_rate", *growth]
        columns = [*first, "rejected", *judged, *seconds]
        self._table = Table(folder / COUPLING, columns, resumed and resumed["table"])
        times = [float(row[0]) for row in self._table.rows()]
        self._rows = len(times)
        # First and last row of each stretch of steps that had not converged: what is kept does not grow with it.
        self._stretches = [] if resumed is None else stretches(resumed)
        self._unconverged = [time for first, last in self._stretches for time in times[first : last + 1]]
        # The time of the initial values, if they do not agree: they have no row.
        self._unsettled_ms: list[float] = [] if resumed is None else resumed["unsettled_ms"].tolist()

    @property
    def unconverged(self) -> list[float]:
        """The times in ms of what was accepted although it had not converged, the initial values included."""
        return self._unsettled_ms + self._unconverged

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer; the initial state is no step."""
        sweeps = step.sweeps
        if step.number:
            seconds = [step.seconds[unit] for unit in (*self._units, MASTER)]
            # A loop one of whose units did not step in this exchange was none.
            norms = sweeps.residuals
            residuals = [norms.get(name) for name in self._converged]
            growth = [step.growth.get(name) for name in self._alternating]
            first = [step.time_ms, step.size_ms, sweeps.iterations, *residuals, sweeps.contraction_rate, *growth]
            judged = [step.error, int(step.missed)] if self._adaptive else []
            self._table.add([*first, step.rejected, *judged, *seconds])
            if not sweeps.converged:
                self._note(step.time_ms)
            self._rows += 1
        elif not sweeps.converged:
            self._unsettled_ms = [step.time_ms]

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return {
            "table": self._table.memory(),
            "unconverged": np.array(self._stretches, np.int64),
            "unsettled_ms": np.array(self._unsettled_ms),
        }

    def close(self) -> None:
        """Close the file."""
        self._table.close()

    def _note(self, time_ms: float) -> None:
        """The step of the next row, to `time_ms`, was accepted without having converged."""
        self._unconverged.append(time_ms)
        before = self._stretches[-1] if self._stretches else None
        if before is not None and before[1] == self._rows - 1:
            self._stretches[-1] = (before[0], self._rows)
        else:
            self._stretches.append((self._rows, self._rows))


def stretches(memory: Mapping[str, Any]) -> list[tuple[int, int]]:
    """First and last row of each stretch of steps that had not converged, from a log's `memory`."""
    return [(int(first), int(last)) for first, last in memory["unconverged"].reshape(-1, 2)]
