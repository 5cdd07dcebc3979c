"""This project's own FMI 2.0 wrapper in C (`fmi2.c`, `python.c`), compiled when the package is built."""

from pathlib import Path


def library() -> Path | None:
    """The compiled wrapper; None where the package was built without a C compiler."""
    return next(iter(sorted(Path(__file__).parent.glob("fmi2.*so"))), None)


def libraries() -> dict[str, Path]:
    """Temporary."""
    return {"x86_64-linux": library()}  # type: ignore[dict-item]
