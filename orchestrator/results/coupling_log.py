"""coupling.csv: what each accepted step cost."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..coupling.exchange import Exchange
from ..coupling.master import MASTER, Accepted
from .table import Table


class CouplingLog:
    """A row per accepted step: step size, sweeps, residuals, rejections and seconds by unit.

    `converged` names the fields that iterated loops exchange ("unit.field"); each has a column with its last residual.
    `contraction_rate` is empty where one sweep measures no rate. Where steps are `adaptive`, `error` is the estimated
    error over the tolerance, empty where there is none, and `tolerance_missed` is 1 where it is above and the step
    could not be any shorter. `unconverged` keeps the times in ms of the steps that were accepted although their
    iteration had not converged. `resumed` is the `memory` of an earlier run.
    """

    def __init__(
        self,
        folder: Path,
        units: Sequence[str],
        converged: Sequence[str] = (),
        adaptive: bool = False,
        resumed: Mapping[str, Any] | None = None,
    ) -> None:
        self.unconverged: list[float] = [] if resumed is None else resumed["unconverged"].tolist()
        self._units = units
        self._converged = converged
        self._adaptive = adaptive
        residuals = [f"residual_{name}" for name in converged]
        seconds = [f"seconds_{unit}" for unit in (*units, MASTER)]
        judged = ["error", "tolerance_missed"] if adaptive else []
        columns = ["time_ms", "step_ms", "iterations", *residuals, "contraction_rate", "rejected", *judged, *seconds]
        self._table = Table(folder / "coupling.csv", columns, None if resumed is None else int(resumed["rows"]))

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer; the initial state is no step."""
        sweeps = step.sweeps
        if not sweeps.converged:
            self.unconverged.append(step.time_ms)
        if step.number:
            seconds = [step.seconds[unit] for unit in (*self._units, MASTER)]
            # A loop one of whose units did not step in this exchange was none.
            residuals = [sweeps.residuals.get(name) for name in self._converged]
            first = [step.time_ms, step.size_ms, sweeps.iterations, *residuals, sweeps.contraction_rate, step.rejected]
            judged = [step.error, int(step.missed)] if self._adaptive else []
            self._table.add([*first, *judged, *seconds])

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return {
            "rows": self._table.rows,
            "unconverged": np.array(self.unconverged),
        }

    def close(self) -> None:
        """Close the file."""
        self._table.close()
