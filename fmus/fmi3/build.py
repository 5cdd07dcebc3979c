"""Building FMI 3.0 FMUs: a unit and a mesh in, a self-contained co-simulation FMU with array variables out.

The FMU carries the code of the units under a private, hashed name, as the FMI 2.0 one does (`fmus.build`). Its binary
is that of pythonfmu3.
"""

import tempfile
from importlib.metadata import distribution, version
from importlib.resources import files
from pathlib import Path

from ...units.mesh import Mesh
from ...units.mesh.archive import pack_mesh
from ...units.unit import Unit
from .. import build as fmi2
from ..annotations import TOOL
from ..archive import write_archive
from ..instance import MESH_FILE
from ..missing_package import MISSING_PACKAGE
from .model_description import model_description

#: What an FMU carries of this folder, besides what one for FMI 2.0 does.
_OWN_FILES = ("__init__.py", "instance.py", "layout.py", "slave.py")
#: And what it does not, whatever the binary of the one for FMI 2.0 is.
_PYTHONFMU_FILE = "fmus/pythonfmu_slave.py"

#: The binary finds its class by a regular expression that wants this base's name, and stops the process if this file
#: cannot be imported; so it imports nothing before the class is called.
_STUB = '''"""The {unit} unit as an FMU: loads the packaged code under a name that is its own."""

import importlib
import sys

Fmi3Slave = object


def _slave():
    return importlib.import_module("{package}.fmus.fmi3.slave")


class {name}(Fmi3Slave):
    def __new__(cls, instance_name, resources, **kwargs):
        try:
            slave = _slave()
        except ModuleNotFoundError as error:
            {missing}
        return slave.Slave("{unit}", resources)

    @staticmethod
    def _fmu_state_to_bytes(state):
        return _slave().state_to_bytes(state)

    @staticmethod
    def _fmu_state_from_bytes(data):
        return _slave().state_from_bytes(data)
'''


def sources() -> dict[str, bytes]:
    """The code an FMU carries, by its path in the package."""
    own = Path(__file__).parent
    shared = {name: content for name, content in fmi2.sources().items() if name != _PYTHONFMU_FILE}
    return shared | {f"fmus/fmi3/{name}": (own / name).read_bytes() for name in _OWN_FILES}


def fingerprint(unit: type[Unit], mesh: Mesh) -> str:
    """A hash of all that decides what the FMI 3.0 FMU of `unit` on `mesh` holds."""
    head = f"FMI 3.0 {unit.name} {version(TOOL)} pythonfmu3 {version('pythonfmu3')}".encode()
    own = Path(__file__).parent
    return fmi2.content_hash(head, [*own.glob("*.py"), *own.parent.glob("*.py")], sources(), mesh)


def build_fmu(unit: type[Unit], mesh: Mesh, destination: Path) -> Path:
    """Write the FMI 3.0 FMU of `unit` on `mesh` to the file `destination` and return it."""
    key = fingerprint(unit, mesh)
    package, code = fmi2.package_of(sources())
    stub = f"{unit.name}_{key[:16]}"
    text = _STUB.format(unit=unit.name, package=package, name=unit.__name__ + key[:16], missing=MISSING_PACKAGE)
    tool = f"{TOOL} {version(TOOL)} with PythonFMU3 {version('pythonfmu3')}"
    token = fmi2.guid_of(key)
    with tempfile.TemporaryDirectory(prefix="cosim-build-") as folder:
        work = Path(folder)
        pack_mesh(mesh, work / MESH_FILE)
        members = {f"resources/{name}": content for name, content in code.items()}
        members |= {
            "modelDescription.xml": model_description(unit, mesh, token, tool).encode(),
            f"resources/{MESH_FILE}": (work / MESH_FILE).read_bytes(),
            f"resources/{stub}.py": text.encode(),
            "resources/slavemodule.txt": stub.encode(),
            f"binaries/x86_64-linux/{unit.name}.so": _binary(),
            "documentation/licenses/pythonfmu3.txt": _license(),
        }
    write_archive(members, destination)
    return destination


def _binary() -> bytes:
    return (files("pythonfmu3") / "resources/binaries/x86_64-linux/libpythonfmu-export.so").read_bytes()


def _license() -> bytes:
    text = distribution("pythonfmu3").read_text("licenses/LICENSE")
    if text is None:
        raise FileNotFoundError("pythonfmu3 comes without its license; install it from the package index")
    return text.encode()
