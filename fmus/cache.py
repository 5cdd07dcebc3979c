"""FMUs built once: kept in the user's cache, or in a folder of their choice, never in the installed package."""

from pathlib import Path

from platformdirs import user_cache_path

from ..units.mesh import Mesh
from ..units.unit import Unit
from .build import build_fmu, fingerprint
from .fmi3.build import build_fmu as build_fmi3
from .fmi3.build import fingerprint as fingerprint_fmi3


def cached_fmu(unit: type[Unit], mesh: Mesh, folder: Path | None = None, fmi: int = 2) -> Path:
    """The FMU of `unit` on `mesh`, built if there is none of the same content, for FMI 2.0 or (`fmi` is 3) FMI 3.0.

    The fingerprint of code and mesh is part of the path, so that an FMU of other code or of another mesh is never
    taken. Without `folder` it is `fmus` in the user's cache of this program.
    """
    root = folder if folder is not None else user_cache_path("cardiac-cosim") / "fmus"
    if fmi not in (2, 3):
        raise ValueError(f"there are FMUs of FMI 2 and 3, not {fmi}")
    key, build = (fingerprint(unit, mesh), build_fmu) if fmi == 2 else (fingerprint_fmi3(unit, mesh), build_fmi3)
    path = root / key[:16] / f"{unit.name}.fmu"
    return path if path.is_file() else build(unit, mesh, path)
