"""Building FMUs: a unit and a mesh in, a self-contained FMI 2.0 co-simulation FMU out.

The FMU carries the code of the units and loads it under a private name that holds a hash of it, so that two FMUs of
different versions in one process never run each other's code. Its binary is this project's own wrapper (`wrapper`),
or pythonfmu's where that could not be compiled. The archive is compressed.
"""

import hashlib
import shutil
import tempfile
import uuid
import zipfile
from importlib.metadata import version
from pathlib import Path

from ..units import registry
from ..units.mesh import Mesh
from ..units.mesh.archive import pack_mesh
from ..units.unit import Unit
from . import wrapper
from .instance import MESH_FILE
from .model_description import TOOL, model_description
from .pythonfmu_build import pythonfmu_archive

#: What an FMU carries of this floor; the units' floor goes whole, but for the geometries (the mesh is in the FMU).
_OWN_FILES = ("__init__.py", "instance.py", "layout.py", "messages.py", "slave.py")
#: And what it needs besides where its binary is pythonfmu's.
_PYTHONFMU_FILE = "pythonfmu_slave.py"
#: The date of every archive member, so that the same content makes the same bytes.
_EPOCH = (2020, 1, 1, 0, 0, 0)
#: Permissions of every archive member; without them Unix unzippers extract files that nobody may read.
_READABLE = 0o100644 << 16

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
        raise ImportError(
            "this FMU needs the Python package '" + str(error.name).partition(".")[0] + "', which the Python "
            + sys.version.split()[0] + " at " + sys.prefix + " does not have; install numpy, scipy, scikit-fem and "
            "meshio there, or name another Python by the environment variable COSIM_PYTHON in hosts without one"
        ) from None
    return slave.Slave("{unit}", resources)
'''


def sources() -> dict[str, bytes]:
    """The code an FMU carries, by its path in the package."""
    own = Path(__file__).parent
    floor = Path(registry.__file__).parent
    modules = sorted(path.relative_to(floor) for path in floor.rglob("*.py"))
    files = {f"units/{path.as_posix()}": (floor / path).read_bytes() for path in modules if path.parts[0] != "geometry"}
    # Code that differs in as little as this has another hash, and is never taken for the other.
    names = _OWN_FILES if wrapper.library() is not None else (*_OWN_FILES, _PYTHONFMU_FILE)
    files |= {f"fmus/{name}": (own / name).read_bytes() for name in names}
    return files | {"__init__.py": b'"""Units and slave, packaged."""\n'}


def fingerprint(unit: type[Unit], mesh: Mesh) -> str:
    """A hash of all that decides what the FMU of `unit` on `mesh` holds."""
    digest = hashlib.sha256(f"{unit.name} {version(TOOL)}".encode())
    library = wrapper.library()
    digest.update(f"pythonfmu {version('pythonfmu')}".encode() if library is None else library.read_bytes())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    for name, content in sources().items():
        digest.update(name.encode() + content)
    digest.update(mesh.fingerprint.encode())
    return digest.hexdigest()


def build_fmu(unit: type[Unit], mesh: Mesh, destination: Path) -> Path:
    """Write the FMU of `unit` on `mesh` to the file `destination` and return it."""
    key = fingerprint(unit, mesh)
    guid = f"{{{uuid.uuid5(uuid.NAMESPACE_OID, key)}}}"
    package, code = package_of(sources())
    destination.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="cosim-build-") as folder:
        work = Path(folder)
        pack_mesh(mesh, work / MESH_FILE)
        library = wrapper.library()
        if library is None:
            members = pythonfmu_archive(unit, key, package, code, work)
            tool = f"{TOOL} {version(TOOL)} with PythonFMU {version('pythonfmu')}"
        else:
            loader = _LOADER.format(unit=unit.name, package=package, guid=guid)
            members = {f"resources/{name}": content for name, content in code.items()}
            members |= {"resources/load.py": loader.encode()}
            members |= {f"resources/{MESH_FILE}": (work / MESH_FILE).read_bytes()}
            members |= {f"binaries/linux64/{unit.name}.so": library.read_bytes()}
            tool = f"{TOOL} {version(TOOL)}"
        members["modelDescription.xml"] = model_description(unit, mesh, guid, tool).encode()
        finished = work / "finished.fmu"
        write_archive(members, finished)
        put(finished, destination)
    return destination


def package_of(files: dict[str, bytes]) -> tuple[str, dict[str, bytes]]:
    """A name that holds a hash of the code `files`, and the files with their paths below it."""
    digest = hashlib.sha256()
    for name, content in files.items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    package = f"cosim_{digest.hexdigest()[:16]}"
    return package, {f"{package}/{name}": content for name, content in files.items()}


def write_archive(members: dict[str, bytes], path: Path) -> None:
    """Write `members` to the archive `path`, compressed and with fixed dates: the same content makes the same bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for name in sorted(members):
            member = zipfile.ZipInfo(name, _EPOCH)
            member.external_attr = _READABLE
            target.writestr(member, members[name], zipfile.ZIP_DEFLATED)


def put(finished: Path, destination: Path) -> None:
    """Copy `finished` to `destination` in one piece, whoever else does so now: nobody ever opens half an FMU."""
    part = destination.with_name(f"{destination.stem}-{uuid.uuid4().hex}.part")
    try:
        shutil.copyfile(finished, part)
        part.replace(destination)
    finally:
        part.unlink(missing_ok=True)
