"""iterations.csv: the residual history of every iterated step."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from .table import Table


class IterationLog:
    """A row per sweep: time, its number, the residual of every field that has a criterion, the contraction rate.

    The rate is the residual over that of the sweep before, of the field where it is largest. `resumed` is the `memory`
    of an earlier run in the same folder.
    """

    def __init__(self, folder: Path, converged: Sequence[str], resumed: Mapping[str, Any] | None = None) -> None:
        self._converged = converged
        columns = ["time_ms", "iteration", *(f"residual_{name}" for name in converged), "contraction_rate"]
        self._table = Table(folder / "iterations.csv", columns, None if resumed is None else int(resumed["rows"]))

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer; the sweeps that made initial values agree are those of no step."""
        for sweep in range(step.sweeps.iterations if step.number and step.sweeps.loops else 0):
            # A loop that converged earlier than another has no such sweep.
            norms: dict[str, float] = {}
            earlier: dict[str, float] = {}
            for loop in step.sweeps.loops:
                norms |= loop.history[sweep] if sweep < len(loop.history) else {}
                earlier |= loop.history[sweep - 1] if 0 < sweep < len(loop.history) else {}
            shrunk = [norms[name] / earlier[name] for name in self._converged if earlier.get(name, 0.0) > 0.0]
            residuals = [norms.get(name) for name in self._converged]
            self._table.add([step.time_ms, sweep + 1, *residuals, max(shrunk, default=None)])

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return {"rows": self._table.rows}

    def close(self) -> None:
        """Close the file."""
        self._table.close()
