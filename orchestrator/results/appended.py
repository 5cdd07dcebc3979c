"""A file that only grows, whole up to the last addition at every moment, and from which a later process can go on."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..writing import writing
from .hdf5 import DamagedFile


class AppendedFile:
    """A new file at `path`, or one that goes on after what the `memory` of an earlier process says was there then.

    What a file has beyond that is removed. Raises DamagedFile if it is not what was written, InputError where nothing
    can be written.
    """

    def __init__(self, path: Path, resumed: Mapping[str, Any] | None = None) -> None:
        self._path = path
        self._digest = hashlib.sha256()
        self._size = 0
        if resumed is not None:
            content = check(path, resumed)
            self._digest.update(content)
            self._size = len(content)
        with writing(path):
            # Nothing is buffered: what was refused once is not tried again when the file is closed.
            self._file = path.open("wb" if resumed is None else "r+b", buffering=0)
            self._file.truncate(self._size)
            self._file.seek(self._size)

    def append(self, content: bytes) -> None:
        """Add `content` and hand it to the operating system; where that is refused, the file is as before."""
        rest = content
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except BaseException as error:
            os.ftruncate(self._file.fileno(), self._size)
            self._file.seek(self._size)
            if isinstance(error, OSError):
                raise OSError(error.errno, error.strerror, str(self._path)) from None
            raise
        self._digest.update(content)
        self._size += len(content)

    def content(self) -> bytes:
        """All that was added."""
        with self._path.open("rb") as file:
            return file.read(self._size)

    def memory(self) -> dict[str, Any]:
        """For a checkpoint; it does not grow with the file."""
        return {"bytes": self._size, "digest": np.frombuffer(self._digest.digest(), np.uint8)}

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def check(path: Path, memory: Mapping[str, Any]) -> bytes:
    """What the file at `path` held according to its `memory`; DamagedFile if it does not hold that any more."""
    size, digest = int(memory["bytes"]), np.asarray(memory["digest"], np.uint8).tobytes()
    try:
        with path.open("rb") as file:
            content = file.read(size)
    except OSError:
        raise DamagedFile(path) from None
    if len(content) != size or hashlib.sha256(content).digest() != digest:
        raise DamagedFile(path)
    return content
