"""Files that are there whole or not at all, whatever ends the process and whatever the operating system refuses."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def unfinished(path: Path) -> Path:
    """Where a file that is to be at `path` is written."""
    return path.with_name(f"{path.name}.part")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write a file to, which takes the place of `path` if nothing is raised, and is removed otherwise."""
    part = unfinished(path)
    try:
        yield part
        os.replace(part, path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        # Refusals to write do not say to what.
        if isinstance(error, OSError) and error.filename is None:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def reserve(path: Path, size: int) -> None:
    """Take the space now that `write_whole` needs later for so many bytes, when there may be none left."""
    unfinished(path).write_bytes(bytes(size))


def write_whole(path: Path, content: bytes | bytearray) -> None:
    """Put a file of this `content` in the place of what is at `path`."""
    with replacing(path) as part, part.open("r+b" if part.exists() else "wb") as file:
        file.write(content)
        file.truncate()
