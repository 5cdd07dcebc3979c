"""Other people's zip archives, FMUs and system packages: read and unpacked without leaving the folder.

Sizes are bounded twice, as the archive declares them and as they turn out while a member is read, so that neither
memory nor disk is filled by a small file that unpacks to gigabytes.
"""

import os
import stat
import struct
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError
from ..quoting import quoted, shortened

#: Bytes of all members together.
LARGEST_ARCHIVE = 4 * 2**30

#: Bytes of one member that is read into memory, a model description for instance: a million variables take 100 MB.
LARGEST_MEMBER = 128 * 2**20

#: Members of an archive; the largest FMUs, with a whole Python in their resources, have 20 000.
_MOST_MEMBERS = 200_000

#: Bytes of the directory at the archive's end, read before the members are known.
_LARGEST_DIRECTORY = 64 * 2**20

#: An archive that unpacks to more than the first number of bytes and to more than so many times its own size is a bomb:
#: descriptions shrink by a factor of 30, zeros by 1000.
_HARMLESS, _LARGEST_RATIO = 256 * 2**20, 200

#: The methods of compression that FMI and SSP allow.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

#: Some of the others, by name.
_OTHER_METHODS = {9: "deflate64", 12: "bzip2", 14: "lzma", 93: "zstandard", 95: "xz"}

_ENCRYPTED = 0x1

_CHUNK = 2**20

#: The end of an archive (APPNOTE.TXT of PKWARE, 4.3.14 to 4.3.16): signature, size, and what may come after it.
_END, _END_SIZE, _LONGEST_COMMENT = b"PK\x05\x06", 22, 2**16
_END_64, _END_64_SIZE, _LOCATOR_64_SIZE = b"PK\x06\x06", 56, 20

#: What zip readers raise on a file that is none, or damaged.
_DAMAGE = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    struct.error,
    EOFError,
    IndexError,
    NotImplementedError,
    OverflowError,
    RuntimeError,
    ValueError,
)


class Archive:
    """An archive whose members have been looked through; see `open_archive`."""

    def __init__(self, archive: zipfile.ZipFile, size: int) -> None:
        self._archive = archive
        self._members = {name: member for member in archive.infolist() if (name := _place(member))}
        _check(archive.infolist(), size)

    def close(self) -> None:
        """Close the file."""
        self._archive.close()

    def __contains__(self, name: str) -> bool:
        return name in self._members

    @property
    def names(self) -> frozenset[str]:
        """The names of all files in it."""
        return frozenset(name for name, member in self._members.items() if not member.is_dir())

    def read(self, name: str, limit: int = LARGEST_MEMBER) -> bytes:
        """The content of the member `name`; InputError if there is none, or one of more than `limit` bytes."""
        member = self._members.get(name)
        if member is None or member.is_dir():
            raise InputError(f"there is no {name} in it")
        if member.file_size > limit:
            raise InputError(f"{name} has {_amount(member.file_size)}, more than {_amount(limit)} are refused")
        # No more than what is declared comes out: zipfile stops there, and the checksum tells the difference.
        with _reading(name), self._archive.open(member) as content:
            return content.read()

    def extract(self, folder: Path) -> None:
        """Unpack all members into the existing `folder`."""
        for name, member in self._members.items():
            path = folder / name
            with _reading(name):
                if member.is_dir():
                    path.mkdir(parents=True, exist_ok=True)
                    continue
                path.parent.mkdir(parents=True, exist_ok=True)
                with self._archive.open(member) as content, path.open("xb") as file:
                    while chunk := content.read(_CHUNK):
                        file.write(chunk)


@contextmanager
def open_archive(path: Path) -> Iterator[Archive]:
    """The archive at `path`.

    Raises
    ------
    InputError
        If it is none, is damaged or encrypted, has members outside of its folder, links, two members of one name, or
        unpacks to more than is sensible. The message names the member and the remedy, not the archive.
    """
    try:
        if not path.is_file():
            raise InputError("no such file")
        archive = _looked_through(path)
    except _DAMAGE as error:
        raise InputError(
            f"it is not a zip archive, or it is damaged ({shortened(str(error))}); write it again"
        ) from None
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror or error})") from None
    try:
        yield archive
    finally:
        archive.close()


def _looked_through(path: Path) -> Archive:
    size = path.stat().st_size
    with path.open("rb") as file:
        if _directory_size(file, size) > _LARGEST_DIRECTORY:
            raise InputError(f"it has more than {_MOST_MEMBERS} members; pack only what is needed")
    archive = zipfile.ZipFile(path)
    try:
        return Archive(archive, size)
    except BaseException:
        archive.close()
        raise


def _directory_size(file: BinaryIO, size: int) -> int:
    """Bytes of the directory of an archive of `size` bytes; 0 where none is found, which zipfile complains of."""
    start = max(0, size - _END_64_SIZE - _LOCATOR_64_SIZE - _END_SIZE - _LONGEST_COMMENT)
    file.seek(start)
    tail = file.read()
    file.seek(0)
    at = tail.rfind(_END)
    if at < 0 or len(tail) < at + _END_SIZE:
        return 0
    declared = int(struct.unpack_from("<L", tail, at + 12)[0])
    wide = tail.rfind(_END_64, 0, at)
    if declared == 2**32 - 1 and wide >= 0 and len(tail) >= wide + _END_64_SIZE:
        return int(struct.unpack_from("<Q", tail, wide + 40)[0])
    return declared


def _place(member: zipfile.ZipInfo) -> str:
    """Where in a folder the `member` belongs, which is empty for the folder itself.

    InputError for a place outside of it, and for what is no file or folder.
    """
    name = member.orig_filename
    parts = [part for part in name.split("/") if part not in ("", ".")]
    if name.startswith("/") or ".." in parts or ":" in name[1:2]:
        raise InputError(f"its member {quoted(name)} would be written outside of the folder; rename it")
    if "\\" in name:
        raise InputError(f"its member {quoted(name)} is named with backslashes; pack it with forward slashes")
    # What can be printed has no control characters; nearly all names can, and each is looked at many times.
    odd = not name.isprintable() and any(unicodedata.category(letter) == "Cc" for letter in name)
    if odd or not (parts or member.is_dir()):
        raise InputError(f"its member {quoted(name)} has no valid file name; rename it")
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        what = "a link" if kind == stat.S_IFLNK else "not a plain file"
        raise InputError(f"its member {quoted(name)} is {what}; pack the file itself")
    return "/".join(parts)


def _check(members: list[zipfile.ZipInfo], size: int) -> None:
    """InputError if the `members` of an archive of `size` bytes cannot all be unpacked, or are not to be."""
    if len(members) > _MOST_MEMBERS:
        raise InputError(f"it has more than {_MOST_MEMBERS} members; pack only what is needed")
    seen: dict[str, tuple[bool, int, int]] = {}
    for member in members:
        name = _place(member)
        content = member.is_dir(), member.file_size, member.CRC
        # Some tools write a folder, or a file, once for each other that it belongs to.
        if name and seen.get(name, content) != content:
            raise InputError(f"its member {quoted(name)} occurs twice with different content; keep one of the two")
        seen[name] = content
        if member.flag_bits & _ENCRYPTED:
            raise InputError(f"its member {quoted(name)} is encrypted; pack it without a password")
        if member.compress_type not in _METHODS:
            method = _OTHER_METHODS.get(member.compress_type, f"method {member.compress_type}")
            raise InputError(f"its member {quoted(name)} is compressed by {method}; pack it with deflate")
    total = sum(member.file_size for member in members)
    if total > LARGEST_ARCHIVE:
        raise InputError(f"it unpacks to {_amount(total)}, more than {_amount(LARGEST_ARCHIVE)} are refused")
    if total > _HARMLESS and total > _LARGEST_RATIO * size:
        raise InputError(
            f"it unpacks from {_amount(size)} to {_amount(total)}, as only archives meant to fill a disk do; "
            "leave out what is not needed"
        )


@contextmanager
def _reading(name: str) -> Iterator[None]:
    """Say which member is damaged, or cannot be written."""
    try:
        yield
    except _DAMAGE as error:
        raise InputError(
            f"its member {quoted(name)} is damaged ({shortened(str(error))}); write the archive again"
        ) from None
    except OSError as error:
        raise InputError(f"its member {quoted(name)} cannot be unpacked ({os.strerror(error.errno or 0)})") from None


def _amount(size: int) -> str:
    return f"{size / 2**20:.0f} MiB" if size >= 2**20 else f"{size} bytes"
