"""The folders that FMUs are unpacked to: one for each participant, and kept for the next one where a process asks so.

Unpacking the hundred files of an FMU in Python takes as long as hundreds of its steps on a single cell. Only this
project's FMUs are kept, which write nothing there; a folder never serves two participants at once.
"""

import shutil
import tempfile
from pathlib import Path

from .fmu_digest import Digest
from .fmu_file import FmuFile

#: Where folders are kept, if they are, and those that nobody uses, by the hash of the FMU.
_place: Path | None = None
_free: dict[str, list[Path]] = {}


def keep_unpacked(place: Path | None) -> None:
    """From now on keep what this process unpacks below the folder `place`, whose owner removes it; None: keep nothing.

    For whoever runs many scenarios in one process.
    """
    global _place
    _place = place
    _free.clear()


class Unpacked:
    """The FMU in `file`, unpacked in a `folder` of its own, until it is given up. InputError where it is damaged."""

    def __init__(self, file: FmuFile, digest: Digest) -> None:
        self._key = file.hash() if _place is not None and digest.fields else None
        self._place = _place
        kept = _free.get(self._key, []) if self._key is not None else []
        while kept:
            self.folder = kept.pop()
            # Who clears away old temporary files may have been there.
            if all((self.folder / name).is_file() for name in digest.names):
                return
            shutil.rmtree(self.folder, ignore_errors=True)
        self.folder = Path(tempfile.mkdtemp(prefix="cosim-fmu-", dir=self._place if self._key is not None else None))
        try:
            file.unpack(self.folder)
        except BaseException:
            self.give_up(whole=False)
            raise

    def give_up(self, whole: bool) -> None:
        """Nobody needs the folder any more; where the FMU worked as a `whole`, the next participant may have it."""
        if whole and self._key is not None and self._place is _place:
            _free.setdefault(self._key, []).append(self.folder)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)
