"""The wrapper's binaries as members of an FMU: one folder for every platform, named as the version of FMI has it."""

import struct
from collections.abc import Sequence
from functools import cache

from . import wrapper

#: Names of platforms in FMI 2.0 (section 2.3), by those of FMI 3.0 (section 2.5.1.4.1); others keep FMI 3.0's. There is
#: one for macOS, whatever the processor.
_FMI2_NAMES = {
    "x86_64-linux": "linux64",
    "x86_64-windows": "win64",
    "x86_64-darwin": "darwin64",
    "aarch64-darwin": "darwin64",
}

#: The header of a universal binary of macOS, and what it says of each of its parts, which begin at whole pages (2^14).
_HEADER, _PART, _PAGE_BITS = struct.Struct(">II"), struct.Struct(">iiIII"), 14
_UNIVERSAL = 0xCAFEBABE
#: Where a binary of one processor says which that is, after its magic number.
_PROCESSOR = struct.Struct("<4xii")


@cache
def binaries(identifier: str, fmi: int) -> dict[str, bytes]:
    """The binaries of an FMU with the model `identifier`, by their paths in it."""
    found: dict[str, list[bytes]] = {}
    for platform, library in wrapper.libraries().items():
        folder = _FMI2_NAMES.get(platform, platform) if fmi == 2 else platform
        found.setdefault(f"binaries/{folder}/{identifier}{library.suffix}", []).append(library.read_bytes())
    return {path: parts[0] if len(parts) == 1 else universal(parts) for path, parts in found.items()}


def universal(parts: Sequence[bytes]) -> bytes:
    """One binary of macOS for several processors, of the `parts` for one each."""
    page = 1 << _PAGE_BITS
    content = bytearray(_HEADER.pack(_UNIVERSAL, len(parts)))
    begin, places = page, []
    for part in parts:
        places.append(begin)
        content += _PART.pack(*_PROCESSOR.unpack_from(part), begin, len(part), _PAGE_BITS)
        begin = (begin + len(part) + page - 1) // page * page
    for place, part in zip(places, parts, strict=True):
        content += bytes(place - len(content)) + part
    return bytes(content)
