"""Builds FMUs of box.c with the C compiler of the machine: one library under any description."""

import shutil
import subprocess
import sys
import sysconfig
import zipfile
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from xml.sax.saxutils import quoteattr

import fmpy

#: What is said of a variable: name, type, causality, value reference, and what stands in its two elements beyond that.
Declared = tuple[str, str, str, int] | tuple[str, str, str, int, str] | tuple[str, str, str, int, str, str]

_PLATFORM = "linux64" if sys.platform == "linux" else "darwin64"


def compiler() -> str | None:
    """A C compiler, if the machine has one."""
    return shutil.which("cc") or shutil.which("gcc")


@cache
def library(talks: bool = False) -> Path:
    """The compiled library, in a folder that goes with the machine's other temporary files."""
    path = Path(mkdtemp(prefix="box-")) / f"box{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-DTALKS"] if talks else []
    source = Path(__file__).with_name("box.c")
    command = [str(compiler()), "-O1", "-w", "-shared", "-fPIC", f"-I{headers}", *flags, str(source), "-o", str(path)]
    subprocess.run(command, check=True)
    return path


def build_box(
    path: Path,
    variables: list[Declared],
    head: str = "",
    attributes: str = "",
    talks: bool = False,
    root: str = 'fmiVersion="2.0"',
    platform: str = _PLATFORM,
) -> Path:
    """Write an FMU that declares `variables` to `path`.

    `head` stands before them (unit and type definitions), `attributes` in CoSimulation, `root` in the root element.
    """
    lines = [_variable(*variable) for variable in variables]
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription {root} modelName="box" guid="box">'
        '<CoSimulation modelIdentifier="box" canHandleVariableCommunicationStepSize="true" '
        f'canGetAndSetFMUstate="true" canSerializeFMUstate="true" {attributes}/>{head}'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )
    binary = library(talks)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(binary, f"binaries/{platform}/{binary.name}")
    return path


def _variable(name: str, kind: str, causality: str, reference: int, outer: str = "", inner: str = "") -> str:
    if causality in ("input", "parameter") and "start=" not in inner:
        inner += {"Real": ' start="0"', "String": ' start=""', "Boolean": ' start="false"'}.get(kind, ' start="0"')
    if "variability=" not in outer and kind != "Real":
        outer += ' variability="discrete"'
    return (
        f'<ScalarVariable name={quoteattr(name)} valueReference="{reference}" causality="{causality}" {outer}>'
        f"<{kind} {inner}/></ScalarVariable>"
    )
