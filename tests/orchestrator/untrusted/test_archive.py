"""A stranger's FMU or package could write outside of its folder, fill disk and memory, or end in a traceback."""

import os
import resource
import stat
import struct
import subprocess
import sys
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.untrusted.archive import open_archive

GIBIBYTE = 2**30


def packed(path: Path, *members: tuple[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content, method)
    return path


def refused(path: Path, folder: Path) -> str:
    folder.mkdir()
    with pytest.raises(InputError) as caught, open_archive(path) as archive:
        archive.extract(folder)
    message = str(caught.value)
    assert len(message) < 400
    assert "\n" not in message
    return message


def test_what_is_packed_comes_out(tmp_path: Path) -> None:
    """A sound FMU could lose a member, or have its content changed."""
    content = os.urandom(3_000_000)
    folders = [("./", b""), ("binaries/", b""), ("./binaries/", b"")]
    files = [("modelDescription.xml", b"<a/>"), ("./binaries/linux64/ä b.so", content)]
    path = packed(tmp_path / "a.fmu", *folders, *files)
    (folder := tmp_path / "out").mkdir()
    with open_archive(path) as archive:
        assert "modelDescription.xml" in archive
        assert archive.read("modelDescription.xml") == b"<a/>"
        archive.extract(folder)
    assert (folder / "binaries/linux64/ä b.so").read_bytes() == content
    assert sorted(item.name for item in folder.iterdir()) == ["binaries", "modelDescription.xml"]


@pytest.mark.parametrize(
    "name",
    ["../evil", "a/../../evil", "/tmp/evil", "C:/evil", "a\\..\\..\\evil", "..\\evil", "a/\x1bb", "..", "./../x"],
)
def test_no_member_leaves_the_folder(tmp_path: Path, name: str) -> None:
    """Unpacking could overwrite any file of the person's."""
    message = refused(packed(tmp_path / "a.fmu", ("fine", b""), (name, b"x")), tmp_path / "out")
    assert "member" in message
    assert list((tmp_path / "out").iterdir()) == []
    assert sorted(item.name for item in tmp_path.iterdir()) == ["a.fmu", "out"]


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR])
def test_links_and_devices_are_refused(tmp_path: Path, kind: int) -> None:
    """A link to a folder elsewhere, and a member behind it, could write there."""
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        member = zipfile.ZipInfo("resources")
        member.external_attr = (kind | 0o777) << 16
        archive.writestr(member, "/tmp")
    assert "'resources' is" in refused(path, tmp_path / "out")


def test_two_members_of_one_name_are_refused(tmp_path: Path) -> None:
    """What is looked at could be another content than what is run."""
    with pytest.warns(UserWarning, match="Duplicate"):
        path = packed(tmp_path / "a.fmu", ("x", b"1"), ("x", b"2"))
    assert "occurs twice" in refused(path, tmp_path / "out")
    assert "occurs twice" in refused(packed(tmp_path / "b.fmu", ("x", b"1"), ("./x", b"2")), tmp_path / "out2")
    assert "cannot be unpacked" in refused(packed(tmp_path / "c.fmu", ("x", b"1"), ("x/y", b"2")), tmp_path / "out3")
    # Public FMUs have the same file twice, from each of the tools that had a hand in them.
    with pytest.warns(UserWarning, match="Duplicate"):
        path = packed(tmp_path / "d.fmu", ("x", b"1"), ("x", b"1"))
    with open_archive(path) as archive:
        archive.extract(tmp_path / "out4")
    assert (tmp_path / "out4" / "x").read_bytes() == b"1"


def test_other_methods_and_passwords_are_refused_by_name(tmp_path: Path) -> None:
    """An encrypted FMU could end in a traceback of the zip reader."""
    path = packed(tmp_path / "a.fmu", ("x", b"1"), method=zipfile.ZIP_LZMA)
    assert "lzma" in refused(path, tmp_path / "out")
    path = packed(tmp_path / "b.fmu", ("x", b"1"))
    content = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.find(signature) + offset] |= 1
    path.write_bytes(content)
    assert "encrypted" in refused(path, tmp_path / "out2")


def test_names_too_long_for_the_system_are_refused(tmp_path: Path) -> None:
    """A name of 300 bytes, or folders 3000 deep, could end in a traceback."""
    for number, name in enumerate(("x" * 300, "d/" * 3000 + "x")):
        message = refused(packed(tmp_path / f"{number}.fmu", (name, b"1")), tmp_path / f"out{number}")
        assert "cannot be unpacked" in message


def test_damage_anywhere_is_one_message(tmp_path: Path) -> None:
    """A byte changed or a tail missing could end in a traceback, or be taken for the FMU that was packed."""
    whole = packed(tmp_path / "a.fmu", ("modelDescription.xml", b"<a/>" * 50), ("resources/b", bytes(100))).read_bytes()
    for place in range(len(whole)):
        for number, damaged in enumerate(
            (whole[:place], whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        ):
            path = tmp_path / f"{place}-{number}.fmu"
            path.write_bytes(damaged)
            (folder := tmp_path / f"out{place}-{number}").mkdir()
            # What comes out all the same is what was packed.
            with suppress(InputError), open_archive(path) as archive:
                archive.extract(folder)
                assert archive.read("modelDescription.xml") == b"<a/>" * 50
    assert not (tmp_path.parent / "resources").exists()


def bomb(path: Path, size: int, declared: int | None = None) -> Path:
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("resources/zeros", "w", force_zip64=True) as file,
    ):
        for _ in range(size // 2**20):
            file.write(bytes(2**20))
    if declared is not None:
        content = path.read_bytes()
        path.write_bytes(
            content.replace(struct.pack("<L", size), struct.pack("<L", declared)).replace(
                struct.pack("<Q", size), struct.pack("<Q", declared)
            )
        )
    return path


@pytest.mark.parametrize("declared", [None, 1000])
def test_a_bomb_costs_neither_disk_nor_memory(tmp_path: Path, declared: int | None) -> None:
    """An FMU of 0.5 MB could fill the disk, or bring the machine down."""
    path = bomb(tmp_path / "bomb.fmu", GIBIBYTE // 2, declared)
    program = (
        "import sys, pathlib\n"
        "from cardiac_cosim.orchestrator.errors import InputError\n"
        "from cardiac_cosim.orchestrator.untrusted.archive import open_archive\n"
        "try:\n"
        "    with open_archive(pathlib.Path(sys.argv[1])) as archive:\n"
        "        archive.extract(pathlib.Path(sys.argv[2]))\n"
        "except InputError as error:\n"
        "    sys.exit(str(error))\n"
    )
    (folder := tmp_path / "out").mkdir()
    done = subprocess.run(
        [sys.executable, "-c", program, path, folder],
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (GIBIBYTE // 4, GIBIBYTE // 4)),
    )
    assert done.returncode == 1, done.stderr
    assert ("fill a disk" if declared is None else "damaged") in done.stderr
    assert sum(item.stat().st_size for item in folder.rglob("*") if item.is_file()) <= (declared or 0)


def test_a_member_for_memory_is_bounded(tmp_path: Path) -> None:
    """A model description of gigabytes could be read into memory."""
    path = packed(tmp_path / "a.fmu", ("modelDescription.xml", bytes(2000)))
    with open_archive(path) as archive:
        assert len(archive.read("modelDescription.xml", limit=2000)) == 2000
        with pytest.raises(InputError, match="more than 1999 bytes"):
            archive.read("modelDescription.xml", limit=1999)
        with pytest.raises(InputError, match=r"there is no modeldescription\.xml"):
            archive.read("modeldescription.xml")


def test_a_directory_for_memory_is_bounded(tmp_path: Path) -> None:
    """An archive of a million empty members could take gigabytes before any of them is looked at."""
    path = tmp_path / "a.fmu"
    with path.open("wb") as file:
        file.truncate(100 * 2**20)
        file.seek(0, os.SEEK_END)
        file.write(struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 65535, 65535, 99 * 2**20, 2**20, 0))
    assert "more than 200000 members" in refused(path, tmp_path / "out")


def test_what_is_no_archive_is_told(tmp_path: Path) -> None:
    """A folder, a missing file or a text could end in a traceback."""
    (tmp_path / "text").write_text("hello")
    (tmp_path / "empty").touch()
    for number, name in enumerate(("text", "empty", "missing", "")):
        assert "no" in refused(tmp_path / name, tmp_path / f"out{number}")
