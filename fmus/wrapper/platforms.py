"""The platforms that FMUs run on, by FMI 3's platform tuples, and the wrapper's binary on each.

Standard library only: the build of the package reads it before there is a package.
"""

import platform

#: FMI 3's platform tuple (its section 2.5.1.4.1), and the file in `binaries/<platform tuple>/`.
BINARIES = {
    "x86_64-linux": "cosim_fmu.so",
    "aarch64-linux": "cosim_fmu.so",
    "x86_64-windows": "cosim_fmu.dll",
    "x86_64-darwin": "cosim_fmu.dylib",
    "aarch64-darwin": "cosim_fmu.dylib",
}

#: FMI 3's names of what Python calls otherwise.
_NAMES = {"amd64": "x86_64", "arm64": "aarch64"}


def this_platform() -> str:
    """The platform tuple of this machine, which need not be among BINARIES."""
    machine = platform.machine().lower()
    return f"{_NAMES.get(machine, machine)}-{platform.system().lower()}"
