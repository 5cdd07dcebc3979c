"""The wrapper by itself: a host in C, compiled with the wrapper under the sanitizers, and a slave that is no unit."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest
from cardiac_cosim.fmus import wrapper

HERE = Path(__file__).parent
SOURCES = Path(wrapper.__file__).parent
HEADERS = Path(fmpy.__file__).parent / "c-code"

_SANITIZERS = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
_WARNINGS = ["-std=c11", "-Wall", "-Wextra", "-Werror"]


@dataclass(frozen=True)
class Done:
    """What the host printed, and what the slave was asked."""

    lines: list[str]
    calls: list[str]
    err: str


Run = Callable[..., Done]


def compile_host(program: Path, *flags: str) -> Path:
    """The host, against the headers of the standard."""
    command = [
        "cc",
        "-D_GNU_SOURCE",
        *_WARNINGS,
        *flags,
        f"-I{HEADERS}",
        str(HERE / "host.c"),
        "-o",
        str(program),
        "-ldl",
    ]
    subprocess.run(command, check=True)
    return program


@pytest.fixture(scope="session")
def headers() -> Path:
    """The headers of both standards."""
    return HEADERS


@pytest.fixture
def functions(fmi: int) -> list[str]:
    """The functions of the standard, for FMI 2 those of co-simulation, as its header declares them."""
    text = (HEADERS / f"fmi{fmi}Functions.h").read_text(encoding="utf-8")
    if fmi == 3:
        return re.findall(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", text, re.M)
    both = text[: text.rindex("Functions for FMI2 for Model Exchange")]
    slaves = text[text.rindex("Functions for FMI2 for Co-Simulation") :]
    return re.findall(r"FMI2_Export fmi2\w+TYPE\s+(fmi2\w+);", both + slaves)


@pytest.fixture(scope="session")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Host and wrapper, both under the sanitizers where the compiler has them."""
    folder = tmp_path_factory.mktemp("wrapper")
    (folder / "probe.c").write_text("int main(void) { return 0; }")
    probe = subprocess.run(["cc", *_SANITIZERS, str(folder / "probe.c"), "-o", str(folder / "probe")], check=False)
    flags = _SANITIZERS if probe.returncode == 0 else ["-g", "-O1"]
    library = folder / "cosim_fmu.so"
    # Against the standard's prototypes, which the definitions have to agree with.
    command = ["cc", *_WARNINGS, *flags, "-fPIC", "-shared", "-fvisibility=hidden", f"-I{HEADERS}"]
    sources = sorted(map(str, SOURCES.glob("*.c")))
    subprocess.run([*command, "-DCOSIM_STANDARD_HEADERS", *sources, "-o", str(library), "-ldl"], check=True)
    return compile_host(folder / "host", *flags), library


@pytest.fixture
def resources(tmp_path: Path) -> Path:
    """The resources of an FMU, in a folder whose name has to be encoded in a URI."""
    folder = tmp_path / "an FMU, 100% ours"
    folder.mkdir()
    for name in ("load.py", "slave.py"):
        shutil.copy(HERE / name, folder)
    return folder


@pytest.fixture
def run(sanitized: tuple[Path, Path], resources: Path) -> Run:
    """Let the host do what `words` say, with FMI `fmi`; a crash, a leak of the sanitizers' or a hang fails.

    In FMI 3 a host hears of failures only if it asks for a log, which it does unless it is to be `quiet`.
    """

    def call(
        fmi: int,
        *words: str,
        token: str = "right",
        location: str | None = None,
        quiet: bool = False,
        **environment: str,
    ) -> Done:
        program, library = sanitized
        words = ("loud", *words) if fmi == 3 and not quiet else words
        where = f"{resources}{os.sep}" if fmi == 3 else resources.as_uri()
        command = [str(program), str(library), str(fmi), where if location is None else location, token, *words]
        own = {"ASAN_OPTIONS": "detect_leaks=0", "COSIM_PYTHON": sys.executable, "PATH": os.environ["PATH"]}
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=120, env=own | environment, errors="backslashreplace"
        )
        assert done.returncode == 0, done.stdout + done.stderr
        record = resources / "calls.txt"
        calls = record.read_text(encoding="utf-8").splitlines() if record.is_file() else []
        return Done(done.stdout.splitlines(), calls, done.stderr)

    return call


@pytest.fixture(params=[2, 3])
def fmi(request: pytest.FixtureRequest) -> int:
    """Both versions of FMI."""
    return int(request.param)


@pytest.fixture(scope="session")
def plain_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host without sanitizers, whose memory is its own."""
    return compile_host(tmp_path_factory.mktemp("plain") / "host", "-O1")
