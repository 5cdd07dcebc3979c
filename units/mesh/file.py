"""Meshes on disk: any format meshio reads, boundaries as physical groups; and this project's own archives."""

import zipfile
from contextlib import redirect_stdout
from pathlib import Path

import meshio
import numpy as np

from ..errors import InvalidInput
from .archive import unpack_mesh
from .simplices import Mesh

_TAG = "gmsh:physical"


def read_mesh(path: Path) -> Mesh:
    """Read tetrahedra and their named boundary triangles; node and element order are the file's.

    A NumPy archive (.npz) that `pack_mesh` wrote may hold a mesh of any dimension.

    Raises
    ------
    InvalidInput
        If the file is missing, is not a mesh, holds no tetrahedra or no named groups, or the mesh itself is unsound
        (see :class:`~.mesh.Mesh`). The message begins with the file's path.
    """
    if not path.is_file():
        raise InvalidInput(f"{path}: no such mesh file")
    if path.suffix == ".npz":
        try:
            return unpack_mesh(path)
        # What NumPy raises of an archive that is damaged, or none; and what is wrong with the mesh in it.
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            raise InvalidInput(f"{path}: holds no mesh of this project ({error}); write it anew") from None
    try:
        # meshio tries the formats of an ending one by one, and prints what each of them says.
        with redirect_stdout(None):
            stored = meshio.read(path)
    # meshio answers a file it cannot read with ReadError, SystemExit or whatever its parsers trip over.
    except (Exception, SystemExit) as error:
        raise InvalidInput(f"{path}: meshio cannot read it as a mesh ({error or type(error).__name__})") from error
    if "tetra" not in stored.cells_dict:
        have = ", ".join(sorted(stored.cells_dict)) or "none"
        raise InvalidInput(f"{path}: holds no linear tetrahedra (cell types: {have}); mesh the volume, first order")
    try:
        return Mesh(stored.points, stored.cells_dict["tetra"], _boundaries(stored))
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from None


def _boundaries(stored: meshio.Mesh) -> dict[str, np.ndarray]:
    """Faces by the name of their physical group (gmsh) or of their set of cells (Abaqus and other formats)."""
    triangles = stored.cells_dict.get("triangle", np.empty((0, 3), dtype=np.int64))
    tags = stored.cell_data_dict.get(_TAG, {}).get("triangle")
    groups = {name: int(tag) for name, (tag, dimension) in stored.field_data.items() if dimension == 2}
    named = {name: triangles[tags == tag] for name, tag in groups.items()} if tags is not None else {}
    for name, members in stored.cell_sets_dict.items():
        if "triangle" in members and not name.startswith("gmsh:"):
            named.setdefault(name, triangles[members["triangle"]])
    if not named:
        raise InvalidInput(
            "has no named boundaries; save the surface triangles in physical groups (gmsh's formats do that)"
        )
    return named


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write `mesh` with its boundaries as physical groups, in gmsh's format 2.2 (ASCII, 17 digits)."""
    tags = {name: number for number, name in enumerate(mesh.boundaries, start=1)}
    volume_tag = len(tags) + 1
    faces = np.concatenate(list(mesh.boundaries.values()))
    face_tags = np.concatenate([np.full(len(faces), tags[name]) for name, faces in mesh.boundaries.items()])
    cell_tags = np.full(mesh.elements, volume_tag)
    stored = meshio.Mesh(
        mesh.points,
        [("triangle", faces), ("tetra", mesh.cells)],
        cell_data={tag: [face_tags, cell_tags] for tag in (_TAG, "gmsh:geometrical")},
        field_data={name: np.array([tag, 2]) for name, tag in tags.items()} | {"myocardium": np.array([volume_tag, 3])},
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    meshio.write(path, stored, file_format="gmsh22", binary=False)
