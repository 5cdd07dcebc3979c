"""A mesh as one NumPy archive: what an FMU or a system package carries, read without any mesh library."""

from pathlib import Path

import numpy as np

from .simplices import Mesh

_BOUNDARY = "boundary/"


def pack_mesh(mesh: Mesh, path: Path) -> None:
    """Write `mesh` with its boundaries to `path` (.npz)."""
    boundaries = {_BOUNDARY + name: faces for name, faces in mesh.boundaries.items()}
    np.savez_compressed(path, allow_pickle=False, points=mesh.points, cells=mesh.cells, **boundaries)


def unpack_mesh(path: Path) -> Mesh:
    """The mesh that `pack_mesh` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        boundaries = {key.removeprefix(_BOUNDARY): stored[key] for key in stored.files if key.startswith(_BOUNDARY)}
        return Mesh(stored["points"], stored["cells"], boundaries)
