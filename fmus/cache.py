"""FMUs built once: kept in the user's cache, or in a folder of their choice, never in the installed package."""

import errno
import hashlib
import logging
import time
import zipfile
from contextlib import suppress
from pathlib import Path

from platformdirs import user_cache_path

from ..units.mesh import Mesh
from ..units.unit import Unit
from .archive import put_in_place
from .build import build_fmu, fingerprint, guid_of

_LOG = logging.getLogger(__name__)

#: Bytes of a model description in which the root element's attributes stand.
_HEAD = 1000


def cached_fmu(unit: type[Unit], mesh: Mesh, folder: Path | None = None, fmi: int = 2) -> Path:
    """The FMU of `unit` on `mesh`, built if there is none of the same content, for FMI 2.0 or (`fmi` is 3) FMI 3.0.

    The fingerprint of code and mesh is part of the path, so that an FMU of other code or of another mesh is never
    taken. One that is damaged, is another, or cannot be read is built anew; as every FMU takes its place in one piece,
    two builders at once do no harm. Without `folder` it is `fmus` in the user's cache of this program.

    OSError where the FMU cannot be built there, InvalidInput where its description would be too long.
    """
    root = folder if folder is not None else user_cache() / "fmus"
    if fmi not in (2, 3):
        raise ValueError(f"FMUs can be built for FMI 2 and 3, not for {fmi}")
    key = fingerprint(unit, mesh, fmi)
    path = root / key[:16] / f"{unit.name}.fmu"
    if _holds(path, guid_of(key)):
        _LOG.info("%s: the FMU is in the cache, %s", unit.name, path)
        return path
    begun = time.perf_counter()
    built = build_fmu(unit, mesh, path, fmi)
    _LOG.info("%s: the FMU was built in %.1f s, %s", unit.name, time.perf_counter() - begun, path)
    return built


def user_cache() -> Path:
    """The user's cache of this program, which need not exist; OSError where there is no home for one."""
    path = user_cache_path("cardiac-cosim")
    # Where nobody knows a home folder it would be one called `~`, below the folder that the person is in.
    if not path.is_absolute():
        raise FileNotFoundError(errno.ENOENT, "there is no home folder for a cache", str(path))
    return path


def _holds(path: Path, guid: str) -> bool:
    """Whether the FMU at `path` is the one that is known by `guid`, readable and with all its bytes as written.

    Once that was seen, a hash of the file lies beside it, which tells as much in a tenth of the time.
    """
    seal = path.with_suffix(".sha256")
    try:
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if seal.is_file() and seal.read_text(encoding="ascii") == found:
            return True
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as description:
            whole = guid.encode() in description.read(_HEAD) and archive.testzip() is None
    # A damaged archive ends in whatever its damaged part is taken for: a kind of compression, an encryption, a size.
    except Exception:
        return False
    if whole:
        # Where the cache cannot be written, the FMU is looked through every time.
        with suppress(OSError), put_in_place(seal) as part:
            part.write_text(found, encoding="ascii")
    return whole
