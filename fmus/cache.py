"""FMUs built once: kept in the user's cache, or in a folder of their choice, never in the installed package."""

from pathlib import Path

from platformdirs import user_cache_path

from ..units.mesh import Mesh
from ..units.unit import Unit
from .build import build_fmu, fingerprint


def cached_fmu(unit: type[Unit], mesh: Mesh, folder: Path | None = None) -> Path:
    """The FMU of `unit` on `mesh`, built if there is none of the same content.

    The fingerprint of code and mesh is part of the path, so that an FMU of other code or of another mesh is never
    taken. Without `folder` it is `fmus` in the user's cache of this program.
    """
    root = folder if folder is not None else user_cache_path("cardiac-cosim") / "fmus"
    path = root / fingerprint(unit, mesh)[:16] / f"{unit.name}.fmu"
    return path if path.is_file() else build_fmu(unit, mesh, path)
