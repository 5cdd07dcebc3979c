"""Archives that are the same bytes whenever the content is the same, and that nobody ever sees half written."""

import io
import uuid
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

#: The date of every member, so that the same content makes the same bytes.
_EPOCH = (2020, 1, 1, 0, 0, 0)
#: Permissions of every member; without them Unix unzippers extract files that nobody may read.
_READABLE = 0o100644 << 16


def add(
    archive: zipfile.ZipFile, name: str, content: bytes | Iterable[str], compression: int = zipfile.ZIP_DEFLATED
) -> None:
    """Add the member `name`: its bytes, or the lines of a text, of which no more than one need be there at a time."""
    member = zipfile.ZipInfo(name, _EPOCH)
    member.external_attr = _READABLE
    if isinstance(content, bytes):
        archive.writestr(member, content, compression)
        return
    member.compress_type = compression
    with archive.open(member, "w") as file, io.TextIOWrapper(file, encoding="utf-8", newline="\n") as text:
        text.writelines(f"{line}\n" for line in content)


def write_archive(members: Mapping[str, bytes | Iterable[str]], destination: Path) -> None:
    """Write an archive of `members`, by name, to the file `destination`, in one piece and compressed."""
    with put_in_place(destination) as part, zipfile.ZipFile(part, "w") as archive:
        for name in sorted(members):
            add(archive, name, members[name])


@contextmanager
def put_in_place(destination: Path) -> Iterator[Path]:
    """A path to write a file to, which takes the place of `destination` when it is complete."""
    destination.parent.mkdir(parents=True, exist_ok=True)
    part = destination.with_name(f"{destination.stem}-{uuid.uuid4().hex}.part")
    try:
        yield part
        part.replace(destination)
    finally:
        part.unlink(missing_ok=True)
