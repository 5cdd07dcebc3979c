"""Meshes on disk: gmsh's own format, any other that meshio reads, and this project's own archives."""

import zipfile
from pathlib import Path

import numpy as np

from ..arrays import IntArray
from ..errors import InvalidInput
from .archive import unpack_mesh
from .faces import faces_of, row_keys
from .meshio_formats import read_by_meshio
from .msh import HEAD, read_msh
from .naming import BOUNDARIES, Naming, named_faces
from .simplices import Mesh
from .stored import StoredMesh, UnreadableMesh

_TAG = "gmsh:physical"

#: Where in a file of gmsh's own format its head is, comments before it included.
_HEAD_WITHIN = 65536

#: A file of more bytes holds more elements than can be computed with.
_LARGEST_BYTES = 2 * 10**9

#: What an archive may unpack to: so many bytes, and more for each of its own. Meshes compress to a third or so.
_ARCHIVE_BYTES, _ARCHIVE_RATIO = 10**8, 20


def read_mesh(path: Path, naming: Naming | None = None, scale: float = 1.0) -> Mesh:
    """Read tetrahedra and their named boundary triangles; node and element order are the file's.

    `naming` says which groups, or numbers in arrays of cell data, make up a boundary, where the file's own names do
    not; coordinates times `scale` are mm. A NumPy archive (.npz) that `pack_mesh` wrote may hold a mesh of any
    dimension.

    What a file has twice is taken once, what belongs to no tetrahedron is left out, and the mesh's notes tell of it.

    Raises
    ------
    InvalidInput
        If the file is missing, is not a mesh, holds no tetrahedra, other cells of tissue or no named groups, or the
        mesh itself is unsound (see :class:`~.mesh.Mesh`). The message begins with the file's path.
    """
    if not path.is_file():
        raise InvalidInput(f"{path}: no such mesh file")
    try:
        if path.suffix == ".npz":
            return _from_archive(path, naming, scale)
        return _cleaned(_stored(path), naming or {}, scale)
    except (InvalidInput, UnreadableMesh) as error:
        raise InvalidInput(f"{path}: {error}") from None


def _from_archive(path: Path, naming: Naming | None, scale: float) -> Mesh:
    if naming:
        raise InvalidInput("a mesh archive names its own boundaries; remove scene.boundaries")
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > _ARCHIVE_BYTES + _ARCHIVE_RATIO * path.stat().st_size:
            raise InvalidInput(f"unpacks to {size / 1e6:.0f} MB, far more than any mesh of its size; write it again")
        mesh = unpack_mesh(path)
    except InvalidInput:
        raise
    # What NumPy raises of an archive that is damaged, or none.
    except Exception as error:
        raise InvalidInput(f"holds no mesh of this project ({error}); write it again") from None
    return mesh if scale == 1.0 else Mesh(scale * mesh.points, mesh.cells, mesh.boundaries, mesh.notes)


def _stored(path: Path) -> StoredMesh:
    size = path.stat().st_size
    if size > _LARGEST_BYTES:
        raise UnreadableMesh(f"has {size / 1e9:.1f} GB, more than any mesh of a heart; choose larger elements")
    try:
        with path.open("rb") as file:
            if HEAD not in file.read(_HEAD_WITHIN):
                return read_by_meshio(path)
            file.seek(0)
            return read_msh(file.read())
    except OSError as error:
        raise UnreadableMesh(f"cannot be read ({error.strerror})") from None


def _cleaned(stored: StoredMesh, naming: Naming, scale: float) -> Mesh:
    """The mesh of what is stored: everything once, and nothing but tetrahedra and faces of their surface."""
    if stored.others:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(stored.others.items()))
        raise InvalidInput(
            f"holds cells other than linear tetrahedra and triangles ({kinds}), and tissue must not be left out; "
            "mesh the whole volume by tetrahedra, first order (in gmsh: Mesh.ElementOrder=1, no recombination)"
        )
    if not len(stored.tetrahedra):
        raise InvalidInput(
            f"holds no linear tetrahedra (but {len(stored.triangles)} triangles); mesh the volume, first order"
        )
    tetrahedra, points = stored.tetrahedra, stored.points
    if tetrahedra.min() < 0 or tetrahedra.max() >= len(points):
        raise InvalidInput("has tetrahedra whose nodes are missing from the file; save the whole mesh")
    notes = list(stored.notes)
    keys = row_keys(tetrahedra, len(points))
    _, first = np.unique(keys, return_index=True)
    if len(first) < len(tetrahedra):
        notes.append(
            f"{len(tetrahedra) - len(first)} of {len(tetrahedra)} tetrahedra are listed twice, as happens where volume "
            "groups overlap; each was taken once"
        )
        tetrahedra = tetrahedra[np.sort(first)]
    used = np.unique(tetrahedra)
    if len(used) < len(points):
        notes.append(f"{len(points) - len(used)} of {len(points)} nodes belong to no tetrahedron and were left out")
    number = np.full(len(points) + 1, -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    cells, points = number[tetrahedra], scale * points[used]
    triangles = stored.triangles
    missing = (triangles < 0) | (triangles >= len(stored.points))
    triangles = number[np.where(missing, len(stored.points), triangles)]
    boundaries = {}
    for name, members in named_faces(stored, naming).items():
        faces, found = _once(triangles[members], len(used))
        if found:
            notes.append(f"{found} faces of the boundary '{name}' are listed twice; each was taken once")
        boundaries[name] = faces
    dropped = _other_groups_inside(boundaries, cells, len(used))
    for name in dropped:
        what = f"{dropped[name]} faces that are not on the surface" if dropped[name] else "no triangles"
        notes.append(f"the group '{name}' has {what}; no unit knows it, so it was left out")
        del boundaries[name]
    return Mesh(points, cells, boundaries, tuple(notes))


def _once(faces: IntArray, nodes: int) -> tuple[IntArray, int]:
    """Each of `faces` once, in their order, and how many there were too many."""
    keys = row_keys(faces + 1, nodes + 1)
    _, first = np.unique(keys, return_index=True)
    return faces[np.sort(first)], len(faces) - len(first)


def _other_groups_inside(boundaries: dict[str, IntArray], cells: IntArray, nodes: int) -> dict[str, int]:
    """How many faces are not on the surface, of each group that no unit knows and that has such, or no faces at all."""
    others = [name for name in boundaries if name not in BOUNDARIES]
    if not others:
        return {}
    surface = faces_of(cells, nodes).surface
    inside = {}
    for name in others:
        keys = row_keys(np.concatenate([surface, boundaries[name]]) + 1, nodes + 1)
        count = int(np.count_nonzero(~np.isin(keys[len(surface) :], keys[: len(surface)])))
        if count or not len(boundaries[name]):
            inside[name] = count
    return inside


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write `mesh` with its boundaries as physical groups, in gmsh's format 2.2 (ASCII, 17 digits)."""
    # Imported here: only who writes a mesh waits for it.
    import meshio

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
