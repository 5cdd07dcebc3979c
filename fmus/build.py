"""Building FMUs: a unit and a mesh in, a self-contained co-simulation FMU of FMI 2.0 or 3.0 out.

The FMU carries the code of the units and loads it under a private name that holds a hash of it, so that two FMUs of
different versions in one process never run each other's code. Its binaries are this project's own wrapper (`wrapper`),
for every platform that it was compiled for. The archive is compressed.
"""

import hashlib
import tempfile
import uuid
from functools import cache
from importlib.metadata import version
from pathlib import Path

from ..units import registry
from ..units.mesh import Mesh
from ..units.mesh.archive import pack_mesh
from ..units.unit import Unit
from .annotations import TOOL
from .archive import write_archive
from .binaries import binaries
from .description import model_description
from .instance import MESH_FILE
from .reference_members import reference_members

#: What an FMU carries of this floor; the units' floor goes whole, but for the geometries (the mesh is in the FMU).
_OWN_FILES = (
    "__init__.py",
    "clock.py",
    "instance.py",
    "layout.py",
    "messages.py",
    "references.py",
    "saved_state.py",
    "slave.py",
)

#: load.py of the resources, which the binary runs.
_LOADER = '''"""Loads the packaged code under a name that is its own."""

import importlib.util
import sys
from pathlib import Path

PACKAGE = "{package}"


def instantiate(resources, token, fmi):
    if token != "{token}":
        raise ValueError("the GUID " + token + " is not that of this FMU; take its modelDescription.xml along with it")
    try:
        if PACKAGE not in sys.modules:
            folder = Path(resources) / PACKAGE
            spec = importlib.util.spec_from_file_location(
                PACKAGE, folder / "__init__.py", submodule_search_locations=[str(folder)]
            )
            sys.modules[PACKAGE] = importlib.util.module_from_spec(spec)
        slave = importlib.import_module(PACKAGE + ".fmus.slave")
    except ModuleNotFoundError as error:
        del sys.modules[PACKAGE]
        raise ImportError(
            "this FMU needs the Python package '" + str(error.name).partition(".")[0] + "', which the Python "
            + sys.version.split()[0] + " at " + sys.prefix + " does not have; install numpy, scipy, scikit-fem and "
            "meshio there; hosts without a Python of their own take that of the environment variable COSIM_PYTHON"
        ) from None
    return slave.Slave("{unit}", resources, fmi)
'''


@cache
def sources() -> dict[str, bytes]:
    """The code an FMU carries, by its path in the package; read once in a process, which runs no other."""
    own = Path(__file__).parent
    floor = Path(registry.__file__).parent
    # Kernels that were compiled when the package was built go along; an FMU without them falls back to NumPy.
    files_there = (path for path in floor.rglob("*") if path.suffix in (".py", ".so"))
    modules = sorted(path.relative_to(floor) for path in files_there)
    files = {f"units/{path.as_posix()}": (floor / path).read_bytes() for path in modules if path.parts[0] != "geometry"}
    files |= {f"fmus/{name}": (own / name).read_bytes() for name in _OWN_FILES}
    return files | {"__init__.py": b'"""Units and slave, packaged."""\n'}


def fingerprint(unit: type[Unit], mesh: Mesh, fmi: int = 2) -> str:
    """A hash of all that decides what the FMU of `unit` on `mesh` holds."""
    digest = hashlib.sha256(f"FMI {fmi} {unit.name} {version(TOOL)} {mesh.fingerprint}".encode())
    # Code that differs in as little as this has another hash, and is never taken for the other.
    own = Path(__file__).parent
    builders = {str(path.relative_to(own)): path.read_bytes() for path in sorted(own.rglob("*.py"))}
    for name, content in (builders | sources() | binaries(unit.name, fmi)).items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    return digest.hexdigest()


def guid_of(key: str) -> str:
    """What an FMU with the fingerprint `key` is known by, in its description and to its binary."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, key)}}}"


def build_fmu(unit: type[Unit], mesh: Mesh, destination: Path, fmi: int = 2) -> Path:
    """Write the FMU of `unit` on `mesh`, of FMI 2.0 or (`fmi` is 3) 3.0, to the file `destination` and return it."""
    token = guid_of(fingerprint(unit, mesh, fmi))
    package, code = _package()
    with tempfile.TemporaryDirectory(prefix="cosim-build-") as folder:
        packed = Path(folder) / MESH_FILE
        pack_mesh(mesh, packed)
        members = {f"resources/{name}": content for name, content in code.items()}
        members |= {
            "modelDescription.xml": model_description(unit, mesh, token, fmi).encode(),
            "resources/load.py": _LOADER.format(unit=unit.name, package=package, token=token).encode(),
            f"resources/{MESH_FILE}": packed.read_bytes(),
        }
        members |= binaries(unit.name, fmi)
        members |= reference_members(unit, mesh, fmi)
    write_archive(members, destination)
    return destination


def _package() -> tuple[str, dict[str, bytes]]:
    """A name that holds a hash of the code, and the code with its paths below it."""
    digest = hashlib.sha256()
    for name, content in sources().items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    package = f"cosim_{digest.hexdigest()[:16]}"
    return package, {f"{package}/{name}": content for name, content in sources().items()}
