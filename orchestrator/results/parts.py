"""A stack of frames as files of their own: each is there whole or not at all, whatever ends the process."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

import h5py

from ..participants.participant import Values
from .writing import writing


class Parts:
    """The frames so far, `<number>.h5` in `folder`, one data set per field and the time as attribute `time_ms`.

    With `kept` those up to that number are kept from an earlier run; all others are removed.
    """

    def __init__(self, folder: Path, kept: int = 0) -> None:
        self.folder = folder
        self.times: list[float] = []
        with writing(folder):
            if kept == 0 and folder.exists():
                shutil.rmtree(folder)
            folder.mkdir(exist_ok=True)
        for number in range(kept):
            with h5py.File(self.path(number)) as file:
                self.times.append(float(file.attrs["time_ms"]))

    def path(self, number: int) -> Path:
        """The file of a frame."""
        return self.folder / f"{number:06d}.h5"

    def add(self, time_ms: float, values: Mapping[str, Values]) -> None:
        """Store a frame."""
        path = self.path(len(self.times))
        unfinished = path.with_suffix(".part")
        with h5py.File(unfinished, "w") as file:
            file.attrs["time_ms"] = time_ms
            for name, array in values.items():
                file[name] = array
        os.replace(unfinished, path)
        self.times.append(time_ms)

    def read(self, number: int, name: str) -> Values:
        """A field of a frame."""
        with h5py.File(self.path(number)) as file:
            return file[name][...]

    def remove(self) -> None:
        """Remove all frames."""
        shutil.rmtree(self.folder, ignore_errors=True)
