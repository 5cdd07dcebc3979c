"""The FMUs' wrapper is compiled here, for all platforms at once; all else about the build is in pyproject.toml.

A C compiler for every platform comes as the Python package ziglang, which pip brings for the build. Where there is none
for this machine, its own `cc` compiles the binary of this platform only. The same sources give the same bytes, wherever
they are.
"""

import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from setuptools import Command, setup
from setuptools.command.build import build
from setuptools.errors import CompileError

_SOURCES = Path(__file__).parent / "fmus" / "wrapper"
_PACKAGE = Path("cardiac_cosim", "fmus", "wrapper")
_PLATFORMS = runpy.run_path(str(_SOURCES / "platforms.py"))
_BINARIES: dict[str, str] = _PLATFORMS["BINARIES"]

_FLAGS = ["-std=c11", "-O2", "-g0", "-Wall", "-Wextra", "-fvisibility=hidden", "-shared"]
_POSIX = ["-fPIC", "-ldl", "-lpthread"]
#: zig's name of each platform, with the oldest C library of Linux that serves.
_TARGETS = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
}


class BuildWrapper(Command):
    """Compiles the wrapper to binaries/<platform tuple>/ in the package, in an editable install in the source tree."""

    description = "compile the wrapper of the FMUs"
    user_options = [("build-lib=", "b", "folder of the package")]  # noqa: RUF012 (setuptools' own way)
    editable_mode = False

    def initialize_options(self) -> None:
        """Before the options are known."""
        self.build_lib: str | None = None

    def finalize_options(self) -> None:
        """Where the other parts of the package go."""
        self.set_undefined_options("build", ("build_lib", "build_lib"))

    def run(self) -> None:
        """Compile for every platform that there is a compiler for."""
        compilers = _compilers()
        folder = _SOURCES if self.editable_mode else Path(str(self.build_lib)) / _PACKAGE
        # What an earlier build left is not that of these sources.
        shutil.rmtree(folder / "binaries", ignore_errors=True)
        with tempfile.TemporaryDirectory(prefix="cosim-wrapper-") as work:
            for name, command in compilers.items():
                made = Path(work, _BINARIES[name])
                _compile([*command, "-o", str(made)], name, Path(work))
                target = folder / "binaries" / name / _BINARIES[name]
                target.parent.mkdir(parents=True)
                shutil.copy2(made, target)

    def get_source_files(self) -> list[str]:
        """What a source distribution has to hold."""
        root = Path(__file__).parent
        return sorted(str(path.relative_to(root)) for path in _SOURCES.glob("*.[ch]"))

    def get_outputs(self) -> list[str]:
        """The files that are built."""
        folder = Path(str(self.build_lib)) / _PACKAGE / "binaries"
        return [str(folder / name / _BINARIES[name]) for name in _compilers()]

    def get_output_mapping(self) -> dict[str, str]:
        """Nothing is copied from the source tree."""
        return {}


def _compilers() -> dict[str, list[str]]:
    """A command without files for each platform that can be compiled for; CompileError if there is none."""
    zig = importlib.util.find_spec("ziglang")
    if zig is not None and zig.origin is not None:
        folder = Path(zig.origin).parent
        return {name: [sys.executable, "-m", "ziglang", "cc", *_zig_flags(name, folder)] for name in _BINARIES}
    here = _PLATFORMS["this_platform"]()
    served = [name for name in _BINARIES if not name.endswith("windows")]
    if here in served and shutil.which("cc"):
        print(f"there is no ziglang here: cc compiles the wrapper of the FMUs for {here} only", file=sys.stderr)
        return {here: ["cc", *_FLAGS, "-s", *_sources(), *_POSIX]}
    raise CompileError(
        f"the wrapper of the FMUs cannot be compiled on {here}: there is neither the Python package ziglang, for all "
        f"platforms, nor a C compiler called cc, which serves {', '.join(served)}; install one of them (ziglang by "
        "pip, which then needs --no-build-isolation), or install a wheel of this package"
    )


def _zig_flags(name: str, zig: Path) -> list[str]:
    command = ["-target", _TARGETS[name], *_FLAGS, "-s", *_sources()]
    if name.endswith("windows"):
        # The C library of Windows itself, instead of MinGW's, whose compilation takes longer than the rest by far.
        headers = str(zig / "lib" / "libc" / "include" / "any-windows-any")
        return [*command, "-nostdlib", "-isystem", headers, "-lkernel32", "-lucrtbase"]
    # On macOS the file is named in itself, by default with the folder that it was built in.
    return command + _POSIX + (["-Wl,-install_name,@rpath/cosim_fmu.dylib"] if name.endswith("darwin") else [])


def _sources() -> list[str]:
    return [path.name for path in sorted(_SOURCES.glob("*.c"))]


def _compile(command: list[str], name: str, cache: Path) -> None:
    caches = {"ZIG_GLOBAL_CACHE_DIR": str(cache / "zig"), "ZIG_LOCAL_CACHE_DIR": str(cache / "zig")}
    try:
        subprocess.run(command, check=True, cwd=_SOURCES, env=os.environ | caches)
    except (OSError, subprocess.CalledProcessError) as error:
        raise CompileError(f"the wrapper of the FMUs cannot be compiled for {name}: {error}") from error


class Build(build):
    """With the wrapper, before the rest: without it there is nothing to install."""

    sub_commands = [("build_wrapper", None), *build.sub_commands]  # noqa: RUF012 (setuptools' own way)


setup(cmdclass={"build": Build, "build_wrapper": BuildWrapper})
