"""profile.json: who was busy when, in the trace event format that Perfetto (ui.perfetto.dev) and Chrome open."""

import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from ..coupling.exchange import Exchange
from ..coupling.master import MASTER, WAITING, Accepted
from ..stopwatch import Span
from .appended import AppendedFile
from .names import PROFILE

_US_PER_S = 1e6


class Profile:
    """A row per unit and one for the master; whole up to the last step at every moment.

    The format allows the closing bracket to be missing, so that events are simply appended.
    """

    def __init__(self, folder: Path, units: Sequence[str]) -> None:
        self._rows = {label: number for number, label in enumerate([MASTER, *units])}
        self._file = AppendedFile(folder / PROFILE)
        self._file.append(b"[\n")
        self._add({"name": "process_name", "ph": "M", "args": {"name": "cosim"}})
        for label, number in self._rows.items():
            self._add({"name": "thread_name", "ph": "M", "tid": number, "args": {"name": label}})

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        lines = [self._span(span, step.time_ms) for span in step.spans if span.label != WAITING]
        self._file.append("".join(lines).encode())

    def close(self) -> None:
        """End the list and close the file."""
        with closing(self._file):
            self._file.append(_line({"name": "end", "ph": "M"}, end="\n]\n"))

    def _add(self, event: dict[str, Any]) -> None:
        self._file.append(_line(event))

    def _span(self, span: Span, time_ms: float) -> str:
        # By hand, as the json module would: there are several spans a step, and it takes most of their time.
        return (
            f'{{"pid": 1, "name": "{span.what}", "ph": "X", "tid": {self._rows[span.label]}, '
            f'"ts": {span.begin * _US_PER_S!r}, "dur": {span.seconds * _US_PER_S!r}, '
            f'"args": {{"time_ms": {time_ms!r}}}}},\n'
        )


def _line(event: dict[str, Any], end: str = ",\n") -> bytes:
    return (json.dumps({"pid": 1, **event}) + end).encode()
