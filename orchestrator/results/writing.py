"""Files in the results folder: what an earlier run left must not pass for this one's, nor stand in its way."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError


def remove_stale(path: Path) -> None:
    """Remove the file at `path`, if there is one; InputError if something is there that cannot be removed."""
    with writing(path):
        path.unlink(missing_ok=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make an InputError of the operating system's refusal to write or remove `path`."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({error.strerror}); remove what is there or choose another --output"
        ) from None
