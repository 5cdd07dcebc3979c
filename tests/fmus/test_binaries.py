"""If these fail, FMUs of FMI 2.0 lack a binary where they should run, on Macs of one of the two processors say."""

import struct
from pathlib import Path

import pytest
from cardiac_cosim.fmus import wrapper
from cardiac_cosim.fmus.binaries import binaries, universal


def _of_processor(kind: int, size: int) -> bytes:
    return struct.pack("<Iii", 0xFEEDFACF, kind, 3) + bytes(range(256)) * size


def test_a_universal_binary_holds_its_parts_at_whole_pages() -> None:
    parts = [_of_processor(0x01000007, 100), _of_processor(0x0100000C, 70)]
    whole = universal(parts)
    magic, count = struct.unpack_from(">II", whole)
    assert (magic, count) == (0xCAFEBABE, 2)
    for number, part in enumerate(parts):
        kind, sub, begin, size, bits = struct.unpack_from(">iiIII", whole, 8 + 20 * number)
        assert (kind, sub) == struct.unpack_from("<4xii", part)
        assert begin % (1 << bits) == 0
        assert whole[begin : begin + size] == part


def test_the_processors_of_macs_share_a_folder_in_fmi_2_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fmi: int
) -> None:
    libraries = {}
    for platform, kind in (("x86_64-darwin", 0x01000007), ("aarch64-darwin", 0x0100000C)):
        libraries[platform] = tmp_path / platform / "cosim_fmu.dylib"
        libraries[platform].parent.mkdir()
        libraries[platform].write_bytes(_of_processor(kind, 10))
    libraries["x86_64-linux"] = tmp_path / "cosim_fmu.so"
    libraries["x86_64-linux"].write_bytes(b"ELF")
    monkeypatch.setattr(wrapper, "libraries", lambda: libraries)
    binaries.cache_clear()
    try:
        found = binaries("unit", fmi)
    finally:
        binaries.cache_clear()
    each = {name: path.read_bytes() for name, path in libraries.items()}
    if fmi == 3:
        assert found == {f"binaries/{name}/unit{libraries[name].suffix}": content for name, content in each.items()}
        return
    macs = universal([each["x86_64-darwin"], each["aarch64-darwin"]])
    assert found == {"binaries/darwin64/unit.dylib": macs, "binaries/linux64/unit.so": b"ELF"}
