"""A stack of frames as files of their own: each is there whole or not at all, whatever ends the process."""

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import h5py

from ..participants.participant import Values
from ..writing import writing
from .hdf5 import DamagedFile, reading_sealed, write_sealed


class Parts:
    """The frames so far, `<number>.h5` in `folder`, one data set per field and the time as attribute `time_ms`.

    With `kept` those up to that number are kept from an earlier run; all others are removed. Raises DamagedFile if one
    of them is not what was written.
    """

    def __init__(self, folder: Path, kept: int = 0) -> None:
        self.folder = folder
        self.times: list[float] = []
        for number in range(kept):
            with self.open(number) as file:
                self.times.append(float(file.attrs["time_ms"]))
        with writing(folder):
            if kept == 0 and folder.exists():
                shutil.rmtree(folder)
            folder.mkdir(exist_ok=True)
            frames = {self.path(number) for number in range(kept)}
            for path in folder.iterdir():
                if path not in frames:
                    path.unlink()

    def path(self, number: int) -> Path:
        """The file of a frame."""
        return _path(self.folder, number)

    def add(self, time_ms: float, values: Mapping[str, Values]) -> None:
        """Store a frame."""

        def fill(file: h5py.File) -> None:
            file.attrs["time_ms"] = time_ms
            for name, array in values.items():
                file[name] = array

        write_sealed(self.path(len(self.times)), fill)
        self.times.append(time_ms)

    @contextmanager
    def open(self, number: int) -> Iterator[h5py.File]:
        """The fields of a frame by name."""
        with _open(self.path(number)) as file:
            yield file

    def remove(self) -> None:
        """Remove all frames."""
        if self.folder.exists():
            shutil.rmtree(self.folder)


def check_parts(folder: Path, kept: int) -> None:
    """DamagedFile if one of so many frames is not what was written."""
    for number in range(kept):
        with _open(_path(folder, number)):
            pass


def _path(folder: Path, number: int) -> Path:
    return folder / f"{number:06d}.h5"


@contextmanager
def _open(path: Path) -> Iterator[h5py.File]:
    try:
        with reading_sealed(path) as file:
            yield file
    except FileNotFoundError:
        raise DamagedFile(path) from None
