"""This project's own wrapper of FMI 2.0 and 3.0 in C, compiled for every platform by `setup.py`."""

from pathlib import Path

from .platforms import BINARIES, this_platform


def libraries() -> dict[str, Path]:
    """The compiled wrapper for each platform, by FMI 3's platform tuple, as far as it was built."""
    folder = Path(__file__).parent / "binaries"
    paths = {name: folder / name / file for name, file in BINARIES.items()}
    return {name: path for name, path in paths.items() if path.is_file()}


def library() -> Path | None:
    """The compiled wrapper for this machine; None where there is none."""
    return libraries().get(this_platform())
