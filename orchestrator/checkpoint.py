"""checkpoint.h5: all that a run needs to go on after its process has ended, in whatever way.

The content is nested dictionaries of arrays and numbers, as groups and data sets. The file is written aside and put in
place at once, so that there always is a whole one.
"""

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import h5py
import numpy as np

from .coupling.exchange import Exchange
from .coupling.master import Accepted
from .errors import InputError
from .scenario import Scenario

_NAME = "checkpoint.h5"
_FORMAT = 1


class Checkpoint:
    """Writes the memories of all `parts` after every `every`-th accepted step, and when asked to.

    Parameters
    ----------
    parts:
        By name, what gives its memory away: the master and everything that writes results.
    """

    def __init__(
        self, folder: Path, scenario: Scenario, every: int, parts: Mapping[str, Callable[[], Mapping[str, Any]]]
    ) -> None:
        self._path = folder / _NAME
        self._scenario = scenario
        self._every = every
        self._parts = parts

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer; to be called after all others."""
        if step.number and step.number % self._every == 0:
            self.write()

    def write(self) -> None:
        """Write a checkpoint of this moment, between two steps."""
        unfinished = self._path.with_suffix(".part")
        with h5py.File(unfinished, "w") as file:
            file.attrs["format"] = _FORMAT
            file.attrs["scenario"] = _text(self._scenario)
            for name, memory in self._parts.items():
                _store(file.create_group(name), memory())
        os.replace(unfinished, self._path)

    def remove(self) -> None:
        """The run is complete: nothing is left to go on from."""
        self._path.unlink(missing_ok=True)


def read_checkpoint(folder: Path, scenario: Scenario) -> dict[str, Any] | None:
    """The memories of the checkpoint in `folder` by part; None if there is no checkpoint.

    InputError if it is of another scenario, or not readable.
    """
    path = folder / _NAME
    if not path.is_file():
        return None
    try:
        with h5py.File(path) as file:
            if file.attrs["format"] != _FORMAT:
                raise ValueError("written by another version")
            before = json.loads(file.attrs["scenario"])
            memories = {name: _load(group) for name, group in file.items()}
    # What h5py raises of a damaged file, and of one that lacks something.
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: no checkpoint of this program ({error}); run without --resume") from None
    changed = _differences(before, json.loads(_text(scenario)))
    if changed:
        raise InputError(
            f"{path}: the checkpoint is of another scenario; {', '.join(changed)} changed since. "
            "Undo that, or run without --resume"
        )
    return memories


def _text(scenario: Scenario) -> str:
    return json.dumps(scenario.resolved(), sort_keys=True)


def _differences(one: Any, other: Any, key: str = "") -> list[str]:
    """The keys at which two scenarios differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            difference
            for name in sorted(one.keys() | other.keys())
            for difference in _differences(one.get(name), other.get(name), f"{key}.{name}" if key else name)
        ]
    return [] if one == other else [key]


def _store(group: h5py.Group, memory: Mapping[str, Any]) -> None:
    # Names of foreign variables may have slashes, which would be groups.
    for name, value in memory.items():
        if isinstance(value, Mapping):
            _store(group.create_group(quote(name, safe="")), value)
        else:
            group[quote(name, safe="")] = value


def _load(group: h5py.Group) -> dict[str, Any]:
    return {
        unquote(name): _load(item) if isinstance(item, h5py.Group) else np.asarray(item[()])
        for name, item in group.items()
    }
