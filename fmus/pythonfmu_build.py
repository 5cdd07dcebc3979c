"""The content of an FMU whose binary is pythonfmu's: pythonfmu packages a stub that loads the packaged code."""

import sys
import zipfile
from importlib.metadata import version
from pathlib import Path

from pythonfmu.builder import FmuBuilder

from ..units.unit import Unit
from .instance import MESH_FILE
from .missing_package import MISSING_PACKAGE

_STUB = '''"""The {unit} unit as an FMU: loads the packaged code under a name that is its own."""

import sys

import pythonfmu

try:
    from {package}.fmus.pythonfmu_slave import Fmi2Status, PythonFmuSlave
except ModuleNotFoundError as error:
    {missing}


class {name}(PythonFmuSlave):
    unit_name = "{unit}"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        known = getattr(pythonfmu, "__version__", "unknown")
        if known != "{version}":
            self.log(
                "this FMU is made for pythonfmu {version}, and its host has loaded pythonfmu " + known + " from "
                + str(pythonfmu.__file__) + "; should it fail, run it in a host that has not",
                Fmi2Status.warning,
            )
'''


def pythonfmu_archive(unit: type[Unit], key: str, package: str, code: dict[str, bytes], work: Path) -> dict[str, bytes]:
    """The members of the FMU of `unit`, by name; `work` is a folder with the mesh, `key` tells FMUs apart."""
    stub = f"{unit.name}_{key[:16]}"
    for name, content in code.items():
        path = work / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    script = work / f"{stub}.py"
    names = {"unit": unit.name, "package": package, "name": unit.__name__ + key[:16], "version": version("pythonfmu")}
    script.write_text(_STUB.format(**names, missing=MISSING_PACKAGE))
    path_before, modules_before = list(sys.path), set(sys.modules)
    try:
        plain = FmuBuilder.build_FMU(
            script, work / "plain.fmu", project_files=[work / package, work / MESH_FILE], needsExecutionTool=False
        )
    finally:
        # The builder imports the stub from the temporary folder and leaves its traces.
        sys.path[:] = path_before
        for module in set(sys.modules) - modules_before:
            if module.startswith((package, stub)):
                del sys.modules[module]
    with zipfile.ZipFile(plain) as archive:
        return {name: archive.read(name) for name in archive.namelist()}
