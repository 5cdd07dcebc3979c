"""iterations.csv: the residual history of every iterated step."""

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from pathlib import Path
from typing import Any

from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from ..coupling.schemes import Sweeps
from .names import ITERATIONS
from .table import Table


class IterationLog:
    """A row per sweep: time, its number, the residual of every field that has a criterion, the contraction rate.

    The rate is the residual over that of the sweep before, of the field where it is largest. `resumed` is the `memory`
    of an earlier run in the same folder.
    """

    def __init__(self, folder: Path, converged: Sequence[str], resumed: Mapping[str, Any] | None = None) -> None:
        self._converged = converged
        columns = ["time_ms", "iteration", *(f"residual_{name}" for name in converged), "contraction_rate"]
        self._table = Table(folder / ITERATIONS, columns, resumed)

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer; the sweeps that made initial values agree are those of no step."""
        if step.number:
            self._add(step.time_ms, step.sweeps)

    def failed(self, time_ms: float, sweeps: Sweeps) -> None:
        """Add the sweeps of a step to `time_ms` that was not accepted."""
        self._add(time_ms, sweeps)

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return self._table.memory()

    def close(self) -> None:
        """Close the file."""
        self._table.close()

    def _add(self, time_ms: float, sweeps: Sweeps) -> None:
        for sweep in range(sweeps.iterations if sweeps.loops else 0):
            # A loop that converged earlier than another has no such sweep.
            norms: dict[str, float] = {}
            earlier: dict[str, float] = {}
            for loop in sweeps.loops:
                norms |= loop.history[sweep] if sweep < len(loop.history) else {}
                earlier |= loop.history[sweep - 1] if 0 < sweep < len(loop.history) else {}
            # A failing step may have left the numbers.
            residuals = [norms[name] if isfinite(norms.get(name, nan)) else None for name in self._converged]
            shrunk = [norms[name] / earlier[name] for name in self._converged if earlier.get(name, 0.0) > 0.0]
            rate = max(shrunk, default=None)
            self._table.add([time_ms, sweep + 1, *residuals, rate if rate is None or isfinite(rate) else None])
