"""The warning that a run is about to fail, while it is still running."""

from rich.console import Console

from .coupling.alternation import GROWING
from .coupling.diagnosis import Diagnosis
from .coupling.exchange import Exchange
from .coupling.growth import Growth
from .coupling.master import Accepted


class Alarm:
    """Reports on the terminal, once for each field, that its alternation from step to step has begun to grow."""

    def __init__(self, growth: Growth, diagnosis: Diagnosis, console: Console) -> None:
        self._growth = growth
        self._diagnosis = diagnosis
        self._console = console
        self._told: set[str] = set()

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        for name, found in self._growth.found.items():
            if found.kind == GROWING and name not in self._told:
                self._told.add(name)
                text = f"warning: {step.time_ms:g} ms: {self._diagnosis.announced(name, found)}"
                self._console.print(text, markup=False, highlight=False, soft_wrap=True)
