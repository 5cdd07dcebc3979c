"""Building FMUs: a unit and a mesh in, a self-contained FMI 2.0 co-simulation FMU out.

The FMU carries the code of the units and loads it under a private name that holds a hash of it, so that two FMUs of
different versions in one process never run each other's code. Its binary is this project's own wrapper (`wrapper`),
or pythonfmu's where that could not be compiled. The archive is compressed.
"""

import hashlib
import tempfile
import uuid
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path

from ..units import registry
from ..units.mesh import Mesh
from ..units.mesh.archive import pack_mesh
from ..units.unit import Unit
from . import wrapper
from .archive import write_archive
from .instance import MESH_FILE
from .missing_package import MISSING_PACKAGE
from .model_description import TOOL, model_description
from .pythonfmu_build import pythonfmu_archive

#: What an FMU carries of this floor; the units' floor goes whole, but for the geometries (the mesh is in the FMU).
_OWN_FILES = ("__init__.py", "instance.py", "layout.py", "messages.py", "slave.py")
#: And what it needs besides where its binary is pythonfmu's.
_PYTHONFMU_FILE = "pythonfmu_slave.py"

_LOADER = '''"""Loads the packaged code under a name that is its own."""

import importlib.util
import sys
from pathlib import Path

PACKAGE = "{package}"


def instantiate(resources, guid):
    if guid != "{guid}":
        raise ValueError("the GUID " + guid + " is not that of this FMU; take its modelDescription.xml along with it")
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
        {missing}
    return slave.Slave("{unit}", resources)
'''


def sources() -> dict[str, bytes]:
    """The code an FMU carries, by its path in the package."""
    # Code that differs in as little as this has another hash, and is never taken for the other.
    return _read(_OWN_FILES if wrapper.library() is not None else (*_OWN_FILES, _PYTHONFMU_FILE))


@cache
def _read(names: tuple[str, ...]) -> dict[str, bytes]:
    """The units' code and the files `names` of this floor; read once in a process, which runs no other."""
    own = Path(__file__).parent
    floor = Path(registry.__file__).parent
    # Kernels that were compiled when the package was built go along; an FMU without them falls back to NumPy.
    files_there = (path for path in floor.rglob("*") if path.suffix in (".py", ".so"))
    modules = sorted(path.relative_to(floor) for path in files_there)
    files = {f"units/{path.as_posix()}": (floor / path).read_bytes() for path in modules if path.parts[0] != "geometry"}
    files |= {f"fmus/{name}": (own / name).read_bytes() for name in names}
    return files | {"__init__.py": b'"""Units and slave, packaged."""\n'}


def fingerprint(unit: type[Unit], mesh: Mesh) -> str:
    """A hash of all that decides what the FMU of `unit` on `mesh` holds."""
    library = wrapper.library()
    binary = f"pythonfmu {version('pythonfmu')}".encode() if library is None else library.read_bytes()
    head = f"{unit.name} {version(TOOL)}".encode() + binary
    return content_hash(head, Path(__file__).parent.glob("*.py"), sources(), mesh)


def guid_of(key: str) -> str:
    """What an FMU with the fingerprint `key` is known by, in its description and to its binary."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, key)}}}"


def content_hash(head: bytes, builders: Iterable[Path], files: dict[str, bytes], mesh: Mesh) -> str:
    """A hash of `head`, of the code that builds an FMU, and of the code and the mesh that it carries."""
    digest = hashlib.sha256(head)
    for path in sorted(builders):
        digest.update(path.read_bytes())
    for name, content in files.items():
        digest.update(name.encode() + content)
    digest.update(mesh.fingerprint.encode())
    return digest.hexdigest()


def build_fmu(unit: type[Unit], mesh: Mesh, destination: Path) -> Path:
    """Write the FMU of `unit` on `mesh` to the file `destination` and return it."""
    key = fingerprint(unit, mesh)
    guid = guid_of(key)
    package, code = package_of(sources())
    with tempfile.TemporaryDirectory(prefix="cosim-build-") as folder:
        work = Path(folder)
        pack_mesh(mesh, work / MESH_FILE)
        library = wrapper.library()
        if library is None:
            members = pythonfmu_archive(unit, key, package, code, work)
            tool = f"{TOOL} {version(TOOL)} with PythonFMU {version('pythonfmu')}"
        else:
            loader = _LOADER.format(unit=unit.name, package=package, guid=guid, missing=MISSING_PACKAGE)
            members = {f"resources/{name}": content for name, content in code.items()}
            members |= {"resources/load.py": loader.encode()}
            members |= {f"resources/{MESH_FILE}": (work / MESH_FILE).read_bytes()}
            members |= {f"binaries/linux64/{unit.name}.so": library.read_bytes()}
            tool = f"{TOOL} {version(TOOL)}"
        members["modelDescription.xml"] = model_description(unit, mesh, guid, tool).encode()
    write_archive(members, destination)
    return destination


def package_of(files: dict[str, bytes]) -> tuple[str, dict[str, bytes]]:
    """A name that holds a hash of the code `files`, and the files with their paths below it."""
    digest = hashlib.sha256()
    for name, content in files.items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    package = f"cosim_{digest.hexdigest()[:16]}"
    return package, {f"{package}/{name}": content for name, content in files.items()}
