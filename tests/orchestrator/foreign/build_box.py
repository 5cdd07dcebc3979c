"""Builds FMUs of box.c and box3.c with the C compiler of the machine: one library under any description."""

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
def library(source: str = "box.c", *flags: str) -> Path:
    """The compiled library, in a folder that goes with the machine's other temporary files."""
    path = Path(mkdtemp(prefix="box-")) / f"box{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [str(compiler()), "-O0", "-w", "-std=gnu11", "-shared", "-fPIC", f"-I{headers}", *flags]
    subprocess.run([*command, str(Path(__file__).with_name(source)), "-o", str(path)], check=True)
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
    binary = library("box.c", *(["-DTALKS"] if talks else []))
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


def build_box3(path: Path, variables: str, early: bool = False, updates: bool = False) -> Path:
    """Write an FMU of FMI 3.0 that declares `variables`, the content of ModelVariables, to `path`."""
    ability = 'providesIntermediateUpdate="true"' if updates else ""
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" modelName="box" '
        'instantiationToken="box"><CoSimulation modelIdentifier="box" canHandleVariableCommunicationStepSize="true" '
        f"{ability}/><ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )
    binary = library("box3.c", f"-DEARLY={int(early)}", f"-DUPDATES={int(updates)}")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(binary, f"binaries/{fmpy.platform_tuple}/{binary.name}")
    return path
