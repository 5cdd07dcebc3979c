"""The files in an FMU that a manifest of FMI-LS-REF refers to: found by their URIs, and never outside of the FMU."""

from pathlib import Path
from posixpath import dirname, join, normpath
from urllib.parse import unquote, urlsplit

from ...fmus.reference_members import FOLDER, MANIFEST
from ..errors import InputError
from ..participants.fmu_file import FmuFile
from ..quoting import shortened
from ..untrusted.archive import LARGEST_MEMBER, open_archive

#: Where the manifest is (FMI 3.0, section 2.5.1: layered standards).
MANIFEST_PATH = f"{FOLDER}/{MANIFEST}"


class ReferenceFiles:
    """The files of the FMU at `path`, an archive or the folder of one; InputError where it is none."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.names = FmuFile(path).names

    def read(self, name: str) -> bytes:
        """The content of the file `name`, a path in the FMU; InputError where there is none or it is too large."""
        if self._path.is_dir():
            file = self._path / name
            try:
                if file.stat().st_size > LARGEST_MEMBER:
                    raise InputError(f"{name}: more than {LARGEST_MEMBER} bytes are refused")
                return file.read_bytes()
            except OSError as error:
                raise InputError(f"{name}: it cannot be read ({error.strerror})") from None
        with open_archive(self._path) as archive:
            return archive.read(name)

    def refer(self, source: str, origin: str, what: str) -> str:
        """The name of the file that the URI `source` in the file `origin` means, relative to that (RFC 3986).

        InputError, which begins with the FMU's file and `what` is referred to, for one that is not in the FMU.
        """
        try:
            is_elsewhere = bool(urlsplit(source).scheme or urlsplit(source).netloc)
        except ValueError:
            is_elsewhere = True
        plain = unquote(source)
        name = normpath(join(dirname(origin), plain))
        if is_elsewhere or plain.startswith("/") or name.startswith(".."):
            raise InputError(
                f"{origin}: {what}, {shortened(source)}, is not a place in the FMU; put the file into the FMU and "
                "refer to it by a relative path"
            )
        if name not in self.names:
            raise InputError(
                f"{origin}: {what}, {shortened(source)}, is missing: there is no {shortened(name, 200)} in the FMU; "
                "add the file or correct the source"
            )
        return name
