"""Files that are there whole or not at all, whatever ends the process and whatever the operating system refuses."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
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
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_whole(path: Path, content: bytes) -> None:
    """Put a file of this `content` in the place of what is at `path`."""
    with replacing(path) as part:
        part.write_bytes(content)
