"""The file of an FMU: an archive, or a folder that one was unpacked to."""

import hashlib
import io
import shutil
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import fmpy

from ..errors import InputError
from ..untrusted.archive import LARGEST_MEMBER, open_archive
from ..untrusted.document import parse_document

#: What every FMU has.
DESCRIPTION = "modelDescription.xml"


class FmuFile:
    """The FMU at `path`; InputError, here and in every method, where it is none or damaged."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._is_folder = path.is_dir()
        if not self._is_folder and not path.is_file():
            raise InputError("no such FMU")

    @cached_property
    def names(self) -> frozenset[str]:
        """All files in it, with forward slashes."""
        if self._is_folder:
            files = (path for path in self._path.rglob("*") if path.is_file())
            return frozenset(path.relative_to(self._path).as_posix() for path in files)
        with open_archive(self._path) as archive:
            return archive.names

    def hash(self) -> str | None:
        """SHA-256 of the archive's bytes; None for a folder, and where they cannot be read."""
        if self._is_folder:
            return None
        try:
            with self._path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            return None

    def description(self) -> Any:
        """The root element of its model description."""
        if self._is_folder:
            path = self._path / DESCRIPTION
            if not path.is_file():
                raise InputError(f"this folder has no {DESCRIPTION}, so it is not an FMU")
            if path.stat().st_size > LARGEST_MEMBER:
                raise InputError(f"{DESCRIPTION} has more than {LARGEST_MEMBER} bytes")
            content = path.read_bytes()
        else:
            with open_archive(self._path) as archive:
                if DESCRIPTION not in archive:
                    raise InputError(f"this archive has no {DESCRIPTION}, so it is not an FMU")
                content = archive.read(DESCRIPTION)
        with _naming_description():
            return parse_document(content)

    def unpack(self, folder: Path) -> None:
        """Put all files into the existing `folder`: a copy, so that two instances share nothing."""
        if self._is_folder:
            try:
                shutil.copytree(self._path, folder, dirs_exist_ok=True)
            except (OSError, shutil.Error) as error:
                raise InputError(f"the FMU's folder cannot be copied ({error})") from None
            return
        with open_archive(self._path) as archive:
            archive.extract(folder)


@contextmanager
def _naming_description() -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{DESCRIPTION}: {error}") from None


def check_binary(names: Collection[str], description: Any) -> None:
    """InputError if the FMU of the files `names` has no library for this machine; it says for which ones it has."""
    identifier = description.coSimulation.modelIdentifier
    if not identifier:
        raise InputError("its CoSimulation has no modelIdentifier, which names the library; export it again")
    machine = fmpy.platform if description.fmiVersion == "2.0" else fmpy.platform_tuple
    library = f"binaries/{machine}/{identifier}{fmpy.sharedLibraryExtension}"
    if library in names:
        return
    machines = sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1})
    if machine in machines:
        raise InputError(f"it has no {library}, the library that its modelIdentifier names; export it again")
    if machines:
        raise InputError(
            f"it has no library for this platform, {machine}, only for {', '.join(machines)}; export it again"
        )
    if any(name.startswith("sources/") for name in names):
        raise InputError(f"it has source code only, and no library for this platform, {machine}; compile it first")
    raise InputError(f"it has no library for this platform, {machine}, nor for any other; export it again")


def packed(path: Path) -> bytes:
    """The FMU at `path` as the content of an archive; InputError if there is none."""
    if not path.is_dir():
        if not path.is_file():
            raise InputError(f"{path}: no such FMU")
        return path.read_bytes()
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in sorted(FmuFile(path).names):
            archive.write(path / name, name)
    return content.getvalue()
