"""The wrapper's binaries as members of an FMU: one folder for every platform, named as the version of FMI has it."""

from functools import cache

from . import wrapper

#: Names of platforms in FMI 2.0 (section 2.3), by those of FMI 3.0 (section 2.5.1.4.1); others keep FMI 3.0's.
_FMI2_NAMES = {"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"}


@cache
def binaries(identifier: str, fmi: int) -> dict[str, bytes]:
    """The binaries of an FMU with the model `identifier`, by their paths in it."""
    return {
        f"binaries/{_FMI2_NAMES.get(platform, platform) if fmi == 2 else platform}/{identifier}{library.suffix}": (
            library.read_bytes()
        )
        for platform, library in wrapper.libraries().items()
    }
