"""One run at a time in a folder."""

import os
import time
from contextlib import suppress
from pathlib import Path

from filelock import lock_descriptor

from ..errors import InputError
from ..writing import allowed

_NAME = ".lock"

#: How often a folder or its lock may vanish under our hands, because another run ends, before we give up.
_ATTEMPTS = 100

#: How long a folder may still be in use before we say so, in seconds: a process that was killed takes a moment to go.
_PATIENCE_S, _PAUSE_S = 1.0, 0.02


class FolderLock:
    """Makes the folder, if there is none, and holds it for this process until `release`.

    The operating system forgets the lock when the process ends, in whatever way; a file that is left of it does not
    matter. It is removed while it is locked, and who locks a file that is not there any more tries again.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path = folder / _NAME
        self._made: list[Path] = []
        with allowed(folder, "--output"):
            self._descriptor = self._acquire()

    def release(self) -> None:
        """Release the folder, and remove it if it is still empty."""
        with suppress(OSError):
            # Somebody may have removed the folder, and another run have made it again.
            if self._is_in_place(self._descriptor):
                self._path.unlink()
        os.close(self._descriptor)
        with suppress(OSError):
            for folder in reversed(self._made):
                folder.rmdir()

    def _acquire(self) -> int:
        for _ in range(_ATTEMPTS):
            self._make_folder()
            try:
                descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
            except FileNotFoundError:
                continue
            try:
                if not _locked(descriptor):
                    holder = os.pread(descriptor, 20, 0).decode(errors="replace").strip()
                    who = f"process {holder}" if holder else "another process"
                    raise InputError(
                        f"the folder {self._folder} is in use by {who}; wait until that is done, or choose another "
                        "with --output"
                    )
                if self._is_in_place(descriptor):
                    # For those who are refused; on a full disk they do not learn it.
                    with suppress(OSError):
                        os.ftruncate(descriptor, 0)
                        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
                    return descriptor
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)
        raise FileNotFoundError(2, "it is removed again and again", str(self._folder))

    def _make_folder(self) -> None:
        missing = [folder for folder in (self._folder, *self._folder.parents) if not os.path.lexists(folder)]
        self._folder.mkdir(parents=True, exist_ok=True)
        self._made += [folder for folder in reversed(missing) if folder not in self._made]

    def _is_in_place(self, descriptor: int) -> bool:
        """Whether the file is still what everybody else finds under its name."""
        try:
            return os.path.samestat(os.fstat(descriptor), os.stat(self._path))
        except FileNotFoundError:
            return False


def is_in_use(folder: Path) -> bool:
    """Whether a run holds the folder at this moment."""
    try:
        descriptor = os.open(folder / _NAME, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        # Closing gives it back.
        return not lock_descriptor(descriptor, blocking=False)
    finally:
        os.close(descriptor)


def _locked(descriptor: int) -> bool:
    """Lock a file for this process, if that is possible within a moment."""
    until = time.monotonic() + _PATIENCE_S
    while not lock_descriptor(descriptor, blocking=False):
        if time.monotonic() > until:
            return False
        time.sleep(_PAUSE_S)
    return True
