"""If these fail, our wrapper is not what the headers of the standard declare, or takes from Python what some lack."""

import ctypes
import subprocess
from pathlib import Path

import fmpy
from cardiac_cosim.fmus import wrapper

_SOURCES = Path(wrapper.__file__).parent
_HEADERS = Path(fmpy.__file__).parent / "c-code"


def test_it_agrees_with_the_headers_of_the_standard(fmi: int) -> None:
    command = ["cc", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-DCOSIM_STANDARD_HEADERS", f"-I{_HEADERS}"]
    subprocess.run([*command, str(_SOURCES / f"fmi{fmi}.c")], check=True)


def test_every_supported_python_has_the_functions_it_takes() -> None:
    text = (_SOURCES / "python.h").read_text()
    names = [line.split(",")[1].strip() for line in text.splitlines() if line.startswith("    X(")]
    assert len(names) > 25
    assert not [name for name in names if not hasattr(ctypes.pythonapi, name)]
