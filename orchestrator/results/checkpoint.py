"""checkpoint.h5: all that a run needs to go on after its process has ended, in whatever way.

The content is nested dictionaries of arrays and numbers. All their bytes are one data set, `values`, and `index` is
the dictionaries as JSON, with type, shape and place for each array: a data set for each would take five times as long.
The file is written aside and put in place at once, so that there always is a whole one. What it costs does not grow
with the run: of the other files it keeps how long they were, and a hash.
"""

import json
from collections.abc import Callable, Mapping
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import InputError
from .hdf5 import reading_sealed, write_sealed
from .names import CHECKPOINT
from .origin import Origin

_FORMAT = 3
_REMEDY = "run without --resume to start again"

#: What a run goes on from: by part, what that kept.
Memories = Mapping[str, Any]


class Checkpoint:
    """Writes the memories of all `parts` when asked to.

    Parameters
    ----------
    parts:
        By name, what gives its memory away: the master and everything that writes results.
    """

    def __init__(self, folder: Path, origin: Origin, parts: Mapping[str, Callable[[], Mapping[str, Any]]]) -> None:
        self._path = folder / CHECKPOINT
        self._origin = json.dumps(origin.content())
        self._parts = parts

    def write(self) -> None:
        """Write a checkpoint of this moment, between two steps."""
        values = bytearray()
        index = _indexed({name: memory() for name, memory in self._parts.items()}, values, {})

        def fill(file: h5py.File) -> None:
            file.attrs["format"] = _FORMAT
            file["origin"] = self._origin
            file["index"] = json.dumps(index)
            file["values"] = np.frombuffer(values, np.uint8)

        write_sealed(self._path, fill)

    @property
    def exists(self) -> bool:
        """Whether there is one to go on from."""
        try:
            return self._path.is_file()
        # In a folder to which we have lost the rights there is nothing to go on from either.
        except OSError:
            return False

    def remove(self) -> None:
        """Remove the checkpoint: the run is not to be continued."""
        self._path.unlink(missing_ok=True)


def read_checkpoint(folder: Path, origin: Origin) -> Memories | None:
    """The memories of the checkpoint in `folder` by part; None if there is no checkpoint.

    InputError if it is of another origin, or not readable.
    """
    path = folder / CHECKPOINT
    try:
        with reading_sealed(path) as file:
            if int(file.attrs["format"]) != _FORMAT:
                raise ValueError("it was written by another version of this program")
            before = Origin.from_content(json.loads(file["origin"][()]))
            index = json.loads(file["index"][()])
            if not isinstance(index, dict):
                raise ValueError("it holds no state of the run")
            memories = _loaded(index, file["values"][()].tobytes())
    except FileNotFoundError:
        return None
    # What h5py raises of a file that lacks something, and what an operating system does not read.
    except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise InputError(f"{path}: the checkpoint cannot be used ({why}); {_REMEDY}") from None
    changed = origin.changed_keys(before)
    if changed:
        raise InputError(
            f"{path}: the checkpoint belongs to another scenario; {', '.join(changed)} changed since. "
            "Undo these changes, or run without --resume"
        )
    for change in origin.changes(before):
        raise InputError(f"{path}: {change}, or {_REMEDY}")
    return memories


def checkpoint_scenario(folder: Path) -> Any:
    """The resolved scenario that the checkpoint in `folder` is of; None if there is none that can be read."""
    try:
        with reading_sealed(folder / CHECKPOINT) as file:
            return json.loads(file["origin"][()])["scenario"]
    # What h5py raises of a file that lacks something, and what an operating system does not read.
    except (OSError, KeyError, ValueError, TypeError, AttributeError):
        return None


def _indexed(memory: Mapping[str, Any], values: bytearray, known: dict[int, int]) -> dict[str, Any]:
    """`memory` with type, shape and place in place of its arrays, whose bytes are added to `values`.

    An array under several names is there once; `known` are the places of all so far by identity.
    """
    index: dict[str, Any] = {}
    for name, value in memory.items():
        if isinstance(value, Mapping):
            index[name] = _indexed(value, values, known)
            continue
        array = np.asarray(value)
        if array is not value or id(array) not in known:
            known[id(array)] = len(values)
            values += array.tobytes()
        index[name] = [array.dtype.str, array.shape, known[id(array)]]
    return index


def _loaded(index: Mapping[str, Any], content: bytes) -> dict[str, Any]:
    """The memory of which `_indexed` made `index` and `content`; ValueError or TypeError if it made them of none."""
    memory: dict[str, Any] = {}
    for name, entry in index.items():
        if isinstance(entry, dict):
            memory[name] = _loaded(entry, content)
            continue
        kind, shape, begin = entry
        array = np.frombuffer(content, np.dtype(kind), prod(shape), begin).reshape(shape)
        # The arrays are those of their owners from here on.
        memory[name] = array.copy()
    return memory
