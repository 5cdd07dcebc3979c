"""Building FMUs: a unit and a mesh in, a self-contained co-simulation FMU of FMI 2.0 or 3.0 out.

The FMU carries the code of the units, and that of a unit from outside of the project (`own_module`), and loads it under
a private name that holds a hash of it, so that two FMUs of different versions in one process never run each other's
code. Its binaries are this project's own wrapper (`wrapper`), for every platform that it was compiled for. The archive
is compressed.
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
from .annotations import TOOL
from .archive import write_archive
from .binaries import binaries
from .description import check_size, model_description
from .documents import PACKAGES, documents, rendered, shipped
from .instance import MESH_FILE
from .own_module import NAME, is_own, own_module
from .reference_members import reference_members

#: What an FMU carries of this floor; the units' floor goes whole, but for the geometries (the mesh is in the FMU).
_OWN_FILES = (
    "__init__.py",
    "clock.py",
    "coordinates.py",
    "instance.py",
    "layout.py",
    "messages.py",
    "references.py",
    "saved_state.py",
    "slave.py",
)


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
    builders = {
        str(path.relative_to(own)): path.read_bytes()
        for pattern in ("*.py", "templates/*", "icon.*")
        for path in sorted(own.rglob(pattern))
    }
    builders |= {name: shipped(name).encode() for name in ("LICENSE", "CITATION.cff")}
    for name, content in (builders | sources() | own_module(unit) | binaries(unit.name, fmi)).items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    return digest.hexdigest()


def guid_of(key: str) -> str:
    """What an FMU with the fingerprint `key` is known by, in its description and to its binary."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, key)}}}"


def build_fmu(unit: type[Unit], mesh: Mesh, destination: Path, fmi: int = 2) -> Path:
    """Write the FMU of `unit` on `mesh`, of FMI 2.0 or (`fmi` is 3) 3.0, to the file `destination` and return it.

    InvalidInput where its description would be longer than what readers take, where a variable has a unit of measure
    that FMI has not been told, and where the module of a unit from outside of the project cannot be carried
    (`own_module`); nothing is written then.
    """
    check_size(unit, mesh, fmi)
    token = guid_of(fingerprint(unit, mesh, fmi))
    package, code = _package(unit)
    own = {"module": NAME, "kind": unit.__name__} if is_own(unit) else None
    loader = rendered("load.py.in", unit=unit.name, own=own, package=package, token=token, packages=PACKAGES)
    with tempfile.TemporaryDirectory(prefix="cosim-build-") as folder:
        packed = Path(folder) / MESH_FILE
        pack_mesh(mesh, packed)
        members: dict[str, bytes | Iterable[str]] = {f"resources/{name}": content for name, content in code.items()}
        members |= {
            "modelDescription.xml": model_description(unit, mesh, token, fmi),
            "resources/load.py": loader,
            f"resources/{MESH_FILE}": packed.read_bytes(),
        }
    members |= binaries(unit.name, fmi) | documents(unit, mesh, fmi) | reference_members(unit, mesh, fmi)
    write_archive(members, destination)
    return destination


def _package(unit: type[Unit]) -> tuple[str, dict[str, bytes]]:
    """A name that holds a hash of the code, and the code with its paths below it."""
    code = sources() | own_module(unit)
    digest = hashlib.sha256()
    for name, content in code.items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    package = f"cosim_{digest.hexdigest()[:16]}"
    return package, {f"{package}/{name}": content for name, content in code.items()}
