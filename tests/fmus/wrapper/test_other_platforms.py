"""If these fail, FMUs built here do not run elsewhere, or are others each time they are built."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from cardiac_cosim.fmus import wrapper
from cardiac_cosim.fmus.wrapper.platforms import BINARIES, this_platform

_HERE = Path(__file__).parent
_MAGIC = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xcf\xfa\xed\xfe"}
#: A Python for Windows that the slave may be tried with, by its path in Wine.
_PYTHON = "COSIM_WINDOWS_PYTHON"
_WINE = shutil.which("wine") or shutil.which("wine64") or ""


def test_this_machine_has_its_binary() -> None:
    assert this_platform() in BINARIES
    assert wrapper.library() == wrapper.libraries()[this_platform()]


def test_every_binary_is_one_of_its_platform() -> None:
    for name, path in wrapper.libraries().items():
        content = path.read_bytes()
        assert content.startswith(_MAGIC[name.split("-")[1]])
        # Stripped, and small enough to be in every FMU five times over.
        assert len(content) < 120_000
        for word in (b"fmi2Instantiate", b"fmi3InstantiateCoSimulation"):
            assert word in content
        # Nothing of the machine it was built on.
        assert str(Path(wrapper.__file__).parent).encode() not in content


def test_windows_needs_nothing_but_windows() -> None:
    path = wrapper.libraries().get("x86_64-windows")
    if path is None:
        pytest.skip("the package was built without ziglang")
    content = path.read_bytes().lower()
    assert b"kernel32.dll" in content
    assert b"ucrtbase.dll" in content
    for other in (b"msvcp", b"vcruntime", b"libgcc", b"python3"):
        assert other + b".dll" not in content


@pytest.fixture(scope="module")
def windows(tmp_path_factory: pytest.TempPathFactory, headers: Path) -> Path:
    """A folder with the host as a program for Windows, the wrapper, and the slave."""
    if find_spec("ziglang") is None:
        pytest.skip("ziglang, which compiles for Windows, is not installed (pip install ziglang)")
    folder = tmp_path_factory.mktemp("windows")
    command = [
        sys.executable,
        "-m",
        "ziglang",
        "cc",
        "-target",
        "x86_64-windows-gnu",
        "-std=c11",
        "-O1",
        f"-I{headers}",
    ]
    subprocess.run([*command, str(_HERE / "host.c"), "-o", str(folder / "host.exe")], check=True)
    for path in (wrapper.libraries()["x86_64-windows"], _HERE / "load.py", _HERE / "slave.py"):
        shutil.copy(path, folder)
    return folder


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """A Wine that runs already: what it starts for itself would hold the pipes of the host open."""
    environment = {"WINEPREFIX": str(tmp_path_factory.mktemp("wine")), "WINEDEBUG": "-all"}
    for command in ([_WINE, "wineboot", "-i"], ["wineserver", "-p"]):
        silent = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        subprocess.run(command, **silent, timeout=120, env=os.environ | environment)
    yield environment
    subprocess.run(["wineserver", "-k"], env=os.environ | environment)


@pytest.fixture
def wine(windows: Path, fmi: int, prefix: dict[str, str]) -> Callable[..., list[str]]:
    """Lets the host for Windows do what `words` say; `python` is the Python that it finds."""

    def run(python: str, location: str, *words: str) -> list[str]:
        done = subprocess.run(
            [_WINE, "host.exe", "cosim_fmu.dll", str(fmi), location, "right", *words],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
            cwd=windows,
            env=os.environ | prefix | {"COSIM_PYTHON": python},
        )
        return done.stdout.splitlines()

    return run


@pytest.mark.long
@pytest.mark.skipif(not _WINE, reason="wine is not installed")
def test_under_wine_the_library_loads_and_says_what_is_missing(
    wine: Callable[..., list[str]], windows: Path, fmi: int, functions: list[str]
) -> None:
    names = [name for name in functions if name[4:] not in ("GetVersion", "GetTypesPlatform", "FreeInstance")]
    names = [name for name in names if not name[4:].startswith("Instantiate")]
    nowhere = r"C:\nowhere\python.exe"
    answers = wine(nowhere, "", "version", *(f"void:{name}" for name in names))
    assert answers == [f"version {fmi}.0", *(f"{name} 3" for name in names)]
    for location in _forms(windows, fmi):
        told, new = wine(nowhere, location, "loud", "new")
        assert rf"the command {nowhere} does not run; set the environment variable COSIM_PYTHON" in told
        assert new == "new 0"
    told, new = wine(nowhere, "C:\\nothing\\", "loud", "new")
    assert told.endswith("there is no file load.py in the resources of the FMU, C:\\nothing")
    assert new == "new 0"


@pytest.mark.long
@pytest.mark.skipif(not _WINE, reason="wine is not installed")
@pytest.mark.skipif(_PYTHON not in os.environ, reason=f"{_PYTHON} names no python.exe for Wine")
def test_under_wine_a_slave_answers(wine: Callable[..., list[str]], windows: Path, fmi: int) -> None:
    kind = "Real" if fmi == 2 else "Float64"
    words = ["new", "start:0:", f"set:{kind}:1:1.5", "exit", f"get:{kind}:1:1", "save", "pack", "drop", "unpack"]
    for location in _forms(windows, fmi):
        lines = wine(os.environ[_PYTHON], location, *words, "restore", "end", "free")
        assert lines[:5] == ["new 1", "start 0", "set 0", "exit 0", "get 0 1.5"]
        assert lines[5:11] == [f"{word} 0" for word in ("save", "pack", "drop", "unpack", "restore", "end")]


def _forms(folder: Path, fmi: int) -> list[str]:
    """The resources in the forms in which hosts on Windows name them."""
    backwards = str(folder).replace("/", "\\")
    uris = [f"file:///Z:{folder}/".replace("windows", "w%69ndows"), f"file:/Z:{folder}", f"file://localhost/Z:{folder}"]
    return [f"Z:{backwards}\\", f"Z:{folder}", *(uris if fmi == 2 else [])]
