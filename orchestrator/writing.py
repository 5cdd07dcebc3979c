"""Errors for folders and files that cannot be written, before a run has begun."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError, RunError

#: No room on the device, for this user, or for so large a file.
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def make_folder(folder: Path, option: str) -> None:
    """Make sure that files can be written to `folder`; InputError names the `option` that chooses another."""
    with allowed(folder, option):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()


@contextmanager
def allowed(folder: Path, option: str) -> Iterator[None]:
    """Make an InputError of the operating system's refusal to write to `folder`, which `option` chooses."""
    try:
        yield
    except OSError as error:
        _raise_if_full(folder, error)
        raise InputError(
            f"the folder {folder} cannot be written ({error.strerror}); choose another with {option}"
        ) from None


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
        _raise_if_full(path, error)
        raise InputError(
            f"{path} cannot be written ({error.strerror}); remove what is there or choose another --output"
        ) from None


def _raise_if_full(path: Path, error: OSError) -> None:
    """RunError where the disk is full: the person's choice is not wrong."""
    if error.errno in _FULL:
        raise RunError(
            f"some results cannot be written ({error.filename or path}: {error.strerror}); make room, or choose "
            "another --output"
        ) from None
