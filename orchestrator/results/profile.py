"""profile.json: who was busy when, in the trace event format that Perfetto (ui.perfetto.dev) and Chrome open."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..coupling.exchange import Exchange
from ..coupling.master import MASTER, WAITING, Accepted
from .writing import writing

_US_PER_S = 1e6


class Profile:
    """A row per unit and one for the master; whole up to the last step at every moment.

    The format allows the closing bracket to be missing, so that events are simply appended.
    """

    def __init__(self, folder: Path, units: Sequence[str]) -> None:
        self._rows = {label: number for number, label in enumerate([MASTER, *units])}
        with writing(folder / "profile.json"):
            self._file = (folder / "profile.json").open("w", encoding="utf-8")
        self._file.write("[\n")
        self._add({"name": "process_name", "ph": "M", "args": {"name": "cosim"}})
        for label, number in self._rows.items():
            self._add({"name": "thread_name", "ph": "M", "tid": number, "args": {"name": label}})

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        for span in step.spans:
            if span.label != WAITING:
                self._add(
                    {
                        "name": span.what,
                        "ph": "X",
                        "tid": self._rows[span.label],
                        "ts": span.begin * _US_PER_S,
                        "dur": span.seconds * _US_PER_S,
                        "args": {"time_ms": step.time_ms},
                    }
                )
        self._file.flush()

    def close(self) -> None:
        """End the list and close the file."""
        self._add({"name": "end", "ph": "M"}, end="\n]\n")
        self._file.close()

    def _add(self, event: dict[str, Any], end: str = ",\n") -> None:
        self._file.write(json.dumps({"pid": 1, **event}) + end)
