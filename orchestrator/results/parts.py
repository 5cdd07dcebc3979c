"""A stack of frames as files of their own: each is there whole or not at all, whatever ends the process.

Their names are those that HDF5 can count by itself (`series`): a data set that is mapped onto them has as many frames
as there are files, whenever it is opened, so that nothing has to be written anew for a frame that is added.
"""

import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from h5py import h5s

from ..participants.participant import Values
from ..writing import writing
from .hdf5 import DamagedFile, image, places, reading_sealed, seal, sealed, write_array, write_mapping

#: The time of a frame beside its fields.
TIME = "time_ms"


class Parts:
    """The frames so far, `<number>.h5` in `folder`, one data set per field and the time as `time_ms`, shape (1,).

    With `kept` those up to that number are kept from an earlier run; all others are removed. Raises DamagedFile if one
    of them is not what was written.
    """

    def __init__(self, folder: Path, kept: int = 0) -> None:
        self.folder = folder
        self.times: list[float] = []
        # All frames are the same file but for the numbers: that of the first one, and where the numbers are.
        self._image = bytearray()
        self._places: dict[str, tuple[int, int]] = {}
        for number in range(kept):
            with self.open(number) as file:
                self.times.append(float(file[TIME][0]))
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
        """Store a frame of the same fields as every other."""
        arrays = {TIME: np.array([time_ms])} | {name: np.asarray(array, np.float64) for name, array in values.items()}
        if not self._image:
            self._lay_out(arrays)
        for name, array in arrays.items():
            begin, size = self._places[name]
            self._image[begin : begin + size] = array.tobytes()
        seal(self.path(len(self.times)), self._image)
        self.times.append(time_ms)

    def _lay_out(self, arrays: Mapping[str, Values]) -> None:
        def fill(file: h5py.File) -> None:
            for name, array in arrays.items():
                write_array(file, name, array)

        self._image = bytearray(image(fill))
        self._places = places(self._image, arrays)

    @contextmanager
    def open(self, number: int) -> Iterator[h5py.File]:
        """The fields of a frame by name."""
        with _open(self.path(number)) as file:
            yield file

    def numbers(self, names: Collection[str]) -> Iterator[dict[str, memoryview]]:
        """The bytes of these fields, by name, of each frame.

        HDF5 is asked once where they are, for to it a small frame is as much work as a large one.
        """
        found: dict[str, tuple[int, int]] = {}
        for number in range(len(self.times)):
            content = _content(self.path(number))
            found = found or places(content, names)
            view = memoryview(content)
            yield {name: view[begin : begin + size] for name, (begin, size) in found.items()}

    def remove(self) -> None:
        """Remove all frames."""
        if self.folder.exists():
            shutil.rmtree(self.folder)


def series(group: h5py.Group, name: str, folder: str, source: str, shape: tuple[int, ...]) -> None:
    """Add the data set `name` to `group`: that of all frames in `folder`, of a field of this `shape` or of the time.

    `folder` is relative to the file of `group`. The data set cannot be read as long as there is no frame.
    """
    space = h5s.create_simple((0, *shape), (h5s.UNLIMITED, *shape))
    rest = len(shape)
    space.select_hyperslab((0,) * (rest + 1), (h5s.UNLIMITED, *[1] * rest), (1,) * (rest + 1), (1, *shape))
    # A percent sign begins what HDF5 counts by.
    names = f"{folder}/%b.h5", source.replace("%", "%%")
    write_mapping(group, name, space, *names, h5s.create_simple(shape or (1,)))


def check_parts(folder: Path, kept: int) -> None:
    """DamagedFile if one of so many frames is not what was written."""
    for number in range(kept):
        with _open(_path(folder, number)):
            pass


def _path(folder: Path, number: int) -> Path:
    return folder / f"{number}.h5"


def _content(path: Path) -> bytes:
    try:
        return sealed(path)
    except FileNotFoundError:
        raise DamagedFile(path) from None


@contextmanager
def _open(path: Path) -> Iterator[h5py.File]:
    try:
        with reading_sealed(path) as file:
            yield file
    except FileNotFoundError:
        raise DamagedFile(path) from None
