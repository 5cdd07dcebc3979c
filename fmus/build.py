"""Building FMUs: a unit and a mesh in, a self-contained FMI 2.0 co-simulation FMU out.

pythonfmu packages a stub; the stub loads the packaged units under a private name that holds a hash of their code, so
that two FMUs of different versions in one process never run each other's code. The model description is written here
(see `model_description`), and the archive is compressed.
"""

import hashlib
import shutil
import sys
import tempfile
import uuid
import zipfile
from importlib.metadata import version
from pathlib import Path

from pythonfmu.builder import FmuBuilder

from ..units import registry
from ..units.mesh import Mesh
from ..units.mesh.archive import pack_mesh
from ..units.unit import Unit
from .model_description import TOOL, model_description
from .slave import MESH_FILE

#: What an FMU carries of this floor; the units' floor goes whole, but for the geometries (the mesh is in the FMU).
_OWN_FILES = ("__init__.py", "layout.py", "slave.py")
#: The date of every archive member, so that the same content makes the same bytes.
_EPOCH = (2020, 1, 1, 0, 0, 0)
#: Permissions of every archive member; without them Unix unzippers extract files that nobody may read.
_READABLE = 0o100644 << 16

_STUB = '''"""The {unit} unit as an FMU: loads the packaged code under a name that is its own."""

from {package}.fmus.slave import UnitSlave


class {name}(UnitSlave):
    unit_name = "{unit}"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
'''


def sources() -> dict[str, bytes]:
    """The code an FMU carries, by its path in the package."""
    own = Path(__file__).parent
    floor = Path(registry.__file__).parent
    modules = sorted(path.relative_to(floor) for path in floor.rglob("*.py"))
    files = {f"units/{path.as_posix()}": (floor / path).read_bytes() for path in modules if path.parts[0] != "geometry"}
    files |= {f"fmus/{name}": (own / name).read_bytes() for name in _OWN_FILES}
    return files | {"__init__.py": b'"""Units and slave, packaged."""\n'}


def fingerprint(unit: type[Unit], mesh: Mesh) -> str:
    """A hash of all that decides what the FMU of `unit` on `mesh` holds."""
    digest = hashlib.sha256(f"{unit.name} {version(TOOL)} {version('pythonfmu')}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    for name, content in sources().items():
        digest.update(name.encode() + content)
    digest.update(mesh.fingerprint.encode())
    return digest.hexdigest()


def _hash_of(files: dict[str, bytes]) -> str:
    digest = hashlib.sha256()
    for name, content in files.items():
        digest.update(f"{name} {len(content)} ".encode() + content)
    return digest.hexdigest()[:16]


def build_fmu(unit: type[Unit], mesh: Mesh, destination: Path) -> Path:
    """Write the FMU of `unit` on `mesh` to the file `destination` and return it."""
    key = fingerprint(unit, mesh)
    files = sources()
    package = "cosim_" + _hash_of(files)
    stub = f"{unit.name}_{key[:16]}"
    destination.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="cosim-build-") as folder:
        work = Path(folder)
        for name, content in files.items():
            path = work / package / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        pack_mesh(mesh, work / MESH_FILE)
        class_name = unit.__name__ + key[:16]
        script = work / f"{stub}.py"
        script.write_text(_STUB.format(unit=unit.name, package=package, name=class_name))
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
        guid = f"{{{uuid.uuid5(uuid.NAMESPACE_OID, key)}}}"
        finished = work / "finished.fmu"
        _repack(plain, finished, model_description(unit, mesh, guid))
        _put(finished, destination)
    return destination


def _put(finished: Path, destination: Path) -> None:
    """Copy `finished` to `destination` in one piece, whoever else does so now: nobody ever opens half an FMU."""
    part = destination.with_name(f"{destination.stem}-{uuid.uuid4().hex}.part")
    try:
        shutil.copyfile(finished, part)
        part.replace(destination)
    finally:
        part.unlink(missing_ok=True)


def _repack(plain: Path, finished: Path, description: str) -> None:
    """Copy the archive, compressed and with fixed dates, and with `description` as its modelDescription.xml."""
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(finished, "w", zipfile.ZIP_DEFLATED) as target:
        for name in sorted(source.namelist()):
            content = description.encode() if name == "modelDescription.xml" else source.read(name)
            member = zipfile.ZipInfo(name, _EPOCH)
            member.external_attr = _READABLE
            target.writestr(member, content, zipfile.ZIP_DEFLATED)
