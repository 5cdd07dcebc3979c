"""HDF5 files that are never half written, and never damaged without our knowing it.

A file that HDF5 cannot write, because the disk is full, it cannot close either, and then it takes the process down at
its end. So HDF5 writes to memory, or to a file object that never fails in its presence; what the operating system
refuses is raised after HDF5 has closed the file.
"""

import errno
import hashlib
import io
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import h5py
import numpy as np
from h5py import h5d, h5f, h5p, h5s, h5t
from numpy.typing import NDArray

from .whole import replacing, write_whole

_DIGEST = hashlib.sha256
_SIZE = _DIGEST().digest_size


#: Bytes by which a file in memory grows.
_BLOCK = 2**20


class DamagedFile(OSError):
    """A file is not what was written."""

    def __init__(self, path: Path) -> None:
        super().__init__(errno.EBADMSG, "it is damaged", str(path))


def write_sealed(path: Path, fill: Callable[[h5py.File], None]) -> None:
    """Put a file that `fill` writes in place, with a hash of its content at the end, which HDF5 does not see."""
    seal(path, image(fill))


def image(fill: Callable[[h5py.File], None]) -> bytes:
    """The content of a file that `fill` writes."""
    with h5py.File("image", "w", driver="core", backing_store=False, block_size=_BLOCK) as file:
        fill(file)
        file.flush()
        content: bytes = file.id.get_file_image()
    return content


def seal(path: Path, content: bytes | bytearray) -> None:
    """Put a file of this `content`, an `image`, in place, with the hash at its end."""
    write_whole(path, content + _DIGEST(content).digest())


@contextmanager
def reading_sealed(path: Path) -> Iterator[h5py.File]:
    """The file that `write_sealed` wrote, open; DamagedFile if it is not what was written, OSError if it is not there.

    No damaged content ever reaches HDF5, which would not survive all of it.
    """
    with h5py.File(h5f.open_file_image(sealed(path))) as file:
        yield file


def sealed(path: Path) -> bytes:
    """The content of the file that `seal` put in place, an `image`; raises like `reading_sealed`."""
    whole = path.read_bytes()
    content, digest = whole[:-_SIZE], whole[-_SIZE:]
    if _DIGEST(content).digest() != digest:
        raise DamagedFile(path)
    return content


def places(content: bytes | bytearray, names: Iterable[str]) -> dict[str, tuple[int, int]]:
    """Where in an `image` the numbers of these data sets are: the first byte, and how many there are."""
    with h5py.File(h5f.open_file_image(bytes(content))) as file:
        return {name: (file[name].id.get_offset(), file[name].id.get_storage_size()) for name in names}


def write_streamed(path: Path, fill: Callable[[h5py.File], None]) -> None:
    """Put a file that `fill` writes in place, without ever having all of it in memory."""
    with replacing(path) as part, part.open("w+b", buffering=0) as raw:
        sink = _Sink(raw)
        try:
            with h5py.File(sink, "w") as file:
                fill(file)
        finally:
            # What HDF5 made of a file that lost what was written to it does not matter.
            if sink.refusal is not None:
                raise OSError(sink.refusal.errno, sink.refusal.strerror, str(path))


def write_mapping(
    group: h5py.Group, name: str, space: h5s.SpaceID, file: str, source: str, source_space: h5s.SpaceID
) -> None:
    """Add the data set of real numbers `name` to `group`, without data: a window on the data set `source` of `file`.

    The selection of `space` shows that of `source_space`. h5py's own layer takes ten times as long.
    """
    properties = _untimed()
    properties.set_virtual(space, file.encode(), source.encode(), source_space)
    h5d.create(group.id, name.encode(), h5t.NATIVE_DOUBLE, space, properties, _intermediate())


def write_array(group: h5py.Group, name: str, values: NDArray[np.float64]) -> None:
    """Add the data set `name` of `values` to `group`; h5py's own layer takes four times as long."""
    space = h5s.create_simple(values.shape)
    data = h5d.create(group.id, name.encode(), h5t.NATIVE_DOUBLE, space, _untimed(), _intermediate())
    data.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values))


def _untimed() -> h5p.PropDCID:
    """A run and its repetition are to be the same file: no data set remembers when it was made."""
    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_obj_track_times(False)
    return properties


@cache
def _intermediate() -> h5p.PropLCID:
    """A name may have slashes, which are groups."""
    properties = h5p.create(h5p.LINK_CREATE)
    properties.set_create_intermediate_group(True)
    return properties


class _Sink:
    """A file for HDF5; once the operating system has refused to write (`refusal`), nothing is written any more."""

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw
        self.refusal: OSError | None = None

    def write(self, data: memoryview) -> int:
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while self.refusal is None and len(rest):
                rest = rest[self._raw.write(rest) :]
        except OSError as error:
            self.refusal = error
        return size

    def truncate(self, size: int) -> int:
        try:
            if self.refusal is None:
                os.ftruncate(self._raw.fileno(), size)
        except OSError as error:
            self.refusal = error
        return size

    def read(self, size: int = -1) -> bytes:
        """Present because h5py recognises a file by it."""
        return self._raw.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        found = self._raw.readinto(buffer) or 0
        memoryview(buffer).cast("B")[found:] = bytes(len(buffer) - found)
        return len(buffer)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def flush(self) -> None:
        """Does nothing, because nothing is buffered."""
