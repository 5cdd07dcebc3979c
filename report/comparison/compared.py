"""Runs that are compared: what they are called, and in which settings they differ."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ...orchestrator.errors import InputError
from ...orchestrator.results.names import SUMMARY, TIME_SERIES
from ...orchestrator.results.stored_run import StoredRun


@dataclass(frozen=True)
class Compared:
    """Two runs or more by name; the first is what the others are compared with."""

    runs: Mapping[str, StoredRun]

    @property
    def reference(self) -> str:
        """The name of the first run."""
        return next(iter(self.runs))

    @property
    def others(self) -> dict[str, StoredRun]:
        """All but the first."""
        return {name: run for name, run in self.runs.items() if name != self.reference}

    @cached_property
    def settings(self) -> dict[str, list[Any]]:
        """The keys at which the resolved scenarios differ, with the value of each run; None where it has none."""
        flat = [dict(_leaves(run.summary.get("scenario") or {})) for run in self.runs.values()]
        keys = dict.fromkeys(key for each in flat for key in each)
        values = {key: [each.get(key) for each in flat] for key in keys}
        return {key: each for key, each in values.items() if any(value != each[0] for value in each)}

    @cached_property
    def notes(self) -> list[str]:
        """What has to be known to judge the differences: runs that did not end well, and other versions."""
        notes = []
        for name, run in self.runs.items():
            status = run.summary.get("status")
            if status != "done":
                notes.append(f"The run {name} is not complete ({status}): it ended at {run.end_ms:g} ms.")
        programs = {(run.summary.get("fingerprints") or {}).get("program") for run in self.runs.values()}
        if len(programs) > 1:
            notes.append("The runs were made by different versions of this program.")
        return notes


def opened(folders: Sequence[Path]) -> Compared:
    """The runs in these results folders; InputError where one holds none, or where one is given twice."""
    runs = {}
    for folder in folders:
        if not (folder / SUMMARY).is_file() or not (folder / TIME_SERIES).is_file():
            raise InputError(
                f"{folder}: there are no results of a run here; give folders that `cosim run` has written, each with a "
                f"{SUMMARY} and a {TIME_SERIES}"
            )
        runs[folder.resolve()] = StoredRun(folder)
    if len(runs) < len(folders) or len(runs) < 2:
        raise InputError("give two results folders or more, each once")
    return Compared(dict(zip(_names(list(runs)), runs.values(), strict=True)))


def _names(folders: Sequence[Path]) -> list[str]:
    """The folders' names, with as much of their paths as tells them apart."""
    if len({folder.name for folder in folders}) == len(folders):
        return [folder.name for folder in folders]
    common = os.path.commonpath(folders)
    return [os.path.relpath(folder, common) for folder in folders]


def _leaves(content: Any, key: str = "") -> list[tuple[str, Any]]:
    """The values of a scenario by their keys; a list is one value."""
    if not isinstance(content, Mapping):
        return [(key, content)]
    return [pair for name, value in content.items() for pair in _leaves(value, f"{key}.{name}" if key else str(name))]
