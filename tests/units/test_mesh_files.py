"""If these fail, a mesh somebody brings is read as another one, hangs the run, or takes the machine with it."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.archive import pack_mesh
from cardiac_cosim.units.mesh.file import read_mesh, write_mesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

_ALL = {"base": [1], "epicardium": [2], "lv_endocardium": [3], "rv_endocardium": [4], "rv_septum": [5]}


class _Stored:
    """The small heart as meshio has it, each boundary with its number, to be written in many ways."""

    def __init__(self, heart: Mesh) -> None:
        self.points, self.cells = heart.points, heart.cells
        self.faces = np.concatenate([heart.boundary(name) for name in _ALL])
        self.tags = np.repeat(np.arange(1, 6), [len(heart.boundary(name)) for name in _ALL])

    def write(self, path: Path, **arrays: np.ndarray) -> Path:
        """With arrays of numbers on the faces."""
        labels = {name: [values, np.full(len(self.cells), 99)] for name, values in arrays.items()}
        meshio.write(
            path, meshio.Mesh(self.points, [("triangle", self.faces), ("tetra", self.cells)], cell_data=labels)
        )
        return path

    def gmsh(self, path: Path) -> Path:
        """In gmsh's version 2.2, with the boundaries' names."""
        tags = [self.tags, np.full(len(self.cells), 9)]
        stored = meshio.Mesh(
            self.points,
            [("triangle", self.faces), ("tetra", self.cells)],
            cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
            field_data={name: np.array([number, 2]) for number, name in enumerate(_ALL, start=1)},
        )
        meshio.write(path, stored, file_format="gmsh22", binary=False)
        return path


@pytest.fixture
def stored(small_heart: Mesh) -> _Stored:
    return _Stored(small_heart)


def _same(mesh: Mesh, heart: Mesh) -> None:
    np.testing.assert_allclose(mesh.points, heart.points, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(mesh.cells, heart.cells)
    assert set(mesh.boundaries) == set(heart.boundaries)
    for name, faces in heart.boundaries.items():
        np.testing.assert_array_equal(mesh.boundary(name), faces)


def _refused(path: Path, naming: Any, *words: str) -> None:
    with pytest.raises(InvalidInput) as refusal:
        read_mesh(path, naming)
    assert str(refusal.value).startswith(f"{path}: ")
    assert len(str(refusal.value)) < 1000
    for word in words:
        assert word in str(refusal.value), str(refusal.value)


# --- names for boundaries that have none ------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["vtu", "vtk", "xdmf", "med", "mesh"])
def test_numbers_in_cell_data_name_the_boundaries(
    ending: str, stored: _Stored, small_heart: Mesh, tmp_path: Path
) -> None:
    array = {"med": "cell_tags", "mesh": "medit:ref"}.get(ending, "surface")
    path = stored.write(tmp_path / f"heart.{ending}", **{array: stored.tags})
    _same(read_mesh(path, _ALL), small_heart)


def test_numbers_that_are_not_there_and_names_that_are_not_told(stored: _Stored, tmp_path: Path) -> None:
    path = stored.write(tmp_path / "heart.vtu", surface=stored.tags)
    _refused(path, None, "no named boundaries", "scene: {boundaries: {base: 1}}", "'surface': 1, 2, 3, 4, 5")
    _refused(path, _ALL | {"base": [7]}, "scene.boundaries.base", "holds [7]", "1, 2, 3, 4, 5")


def test_several_numbers_make_one_boundary(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    stored.tags[(stored.tags == 2) & (small_heart.points[stored.faces].mean(axis=1)[:, 0] > 0)] = 12
    path = stored.write(tmp_path / "heart.vtu", surface=stored.tags.astype(float))
    _same(read_mesh(path, _ALL | {"epicardium": [2, 12]}), small_heart)


def test_the_array_is_the_one_that_has_the_numbers(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    other, halves = np.full(len(stored.faces), 7), stored.tags + 0.5
    path = stored.write(tmp_path / "heart.vtu", region=other, measured=halves, surface=stored.tags)
    _same(read_mesh(path, _ALL), small_heart)
    path = stored.write(tmp_path / "twice.vtu", one=stored.tags, other=6 - stored.tags)
    _refused(path, _ALL, "scene.boundaries.base", "different faces in 'one' and 'other'", "leave one of these arrays")
    _same(read_mesh(stored.write(tmp_path / "equal.vtu", one=stored.tags, other=stored.tags), _ALL), small_heart)


def test_groups_are_renamed_and_joined(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    path = stored.gmsh(tmp_path / "heart.msh")
    path.write_text(path.read_text().replace('"base"', '"BASE"').replace('"rv_septum"', '"RV septum, ü"'))
    naming = {"base": ["BASE"], "rv_septum": ["RV septum, ü"]}
    _same(read_mesh(path, naming), small_heart)
    _same(read_mesh(path, naming | {"base": [1]}), _with_more(small_heart, BASE=small_heart.boundary("base")))
    joined = read_mesh(path, {"epicardium": ["epicardium", "rv_endocardium", 5]}).boundary("epicardium")
    assert len(joined) == 227 + 52 + 38
    _refused(path, {"base": ["Base"]}, "scene.boundaries.base", "no group of triangles named 'Base'", "BASE")
    _refused(path, {"bse": ["BASE"]}, "scene.boundaries.bse", "did you mean 'base'?")
    _refused(path, {"surface": ["BASE"]}, "scene.boundaries.surface", "lv_endocardium")


def _with_more(mesh: Mesh, **boundaries: np.ndarray) -> Mesh:
    return Mesh(mesh.points, mesh.cells, {**mesh.boundaries, **boundaries})


def test_groups_of_med_have_names(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    mesh = meshio.Mesh(
        stored.points,
        [("triangle", stored.faces), ("tetra", stored.cells)],
        cell_data={"cell_tags": [-stored.tags, np.full(len(stored.cells), -9)]},
    )
    mesh.cell_tags = {-number: [name] for number, name in enumerate(_ALL, start=1)} | {-9: ["wall"]}
    mesh.write(tmp_path / "heart.med")
    _same(read_mesh(tmp_path / "heart.med"), small_heart)


def test_coordinates_are_scaled(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    stored.points = stored.points / 10.0
    assert read_mesh(stored.gmsh(tmp_path / "cm.msh"), scale=10.0).volumes.sum() == pytest.approx(
        small_heart.volumes.sum(), rel=1e-12
    )
    pack_mesh(small_heart, tmp_path / "heart.npz")
    assert read_mesh(tmp_path / "heart.npz", scale=2.0).volumes.sum() == pytest.approx(8 * small_heart.volumes.sum())
    _refused(tmp_path / "heart.npz", {"base": ["BASE"]}, "remove scene.boundaries")


# --- twice, beside and between ---------------------------------------------------------------------------------------


def test_faces_and_tetrahedra_listed_twice_are_taken_once(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    lv = stored.tags == 3
    stored.faces = np.vstack([stored.faces, stored.faces[lv][:, [2, 0, 1]]])
    stored.tags = np.append(stored.tags, stored.tags[lv])
    # The same four nodes, begun at another one.
    stored.cells = np.vstack([stored.cells, stored.cells[:300, [1, 2, 0, 3]]])
    mesh = read_mesh(stored.gmsh(tmp_path / "heart.msh"))
    _same(mesh, small_heart)
    assert mesh.notes == (
        "300 of 1145 tetrahedra are listed twice, as happens where volume groups overlap; each was taken once",
        "110 faces of the boundary 'lv_endocardium' are listed twice; each was taken once",
    )


def test_nodes_of_no_tetrahedron_are_left_out_and_the_others_keep_their_order(
    stored: _Stored, small_heart: Mesh, tmp_path: Path
) -> None:
    stored.points = np.insert(stored.points, [0, 100, 271], 5.0, axis=0)
    moved = np.arange(271) + 1 + (np.arange(271) >= 100)
    stored.cells, stored.faces = moved[stored.cells], moved[stored.faces]
    mesh = read_mesh(stored.gmsh(tmp_path / "heart.msh"))
    _same(mesh, small_heart)
    assert mesh.notes == ("3 of 274 nodes belong to no tetrahedron and were left out",)


def test_faces_between_elements(stored: _Stored, small_heart: Mesh, tmp_path: Path) -> None:
    surface = {tuple(face) for face in np.sort(small_heart.surface, axis=1).tolist()}
    inner = next(face for face in np.sort(small_heart.cells[:, :3], axis=1).tolist() if tuple(face) not in surface)
    stored.faces, stored.tags = np.vstack([stored.faces, [inner]]), np.append(stored.tags, 1)
    _refused(stored.gmsh(tmp_path / "heart.msh"), None, "1 of 58 faces of the boundary 'base' are not on the surface")
    # In a group that no unit knows they are left out.
    stored.tags[-1] = 6
    path = stored.gmsh(tmp_path / "more.msh")
    path.write_text(path.read_text().replace("$PhysicalNames\n5\n", '$PhysicalNames\n6\n2 6 "interface"\n'))
    mesh = read_mesh(path)
    _same(mesh, small_heart)
    assert mesh.notes == (
        "the group 'interface' has 1 faces that are not on the surface; no unit knows it, so it was left out",
    )


# --- files that are none ---------------------------------------------------------------------------------------------

_BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa">""" + b"".join(
    b'<!ENTITY %c "%s">' % (98 + level, b"&%c;" % (97 + level) * 50) for level in range(9)
)


@pytest.mark.parametrize("ending", ["vtu", "xdmf"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_xml_that_declares_entities_is_refused(ending: str, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / f"bomb.{ending}"
    path.write_bytes((_BOMB + b"]><VTKFile>&j;</VTKFile>").decode().encode(encoding))
    _refused(path, None, "declares entities or a document type")


def test_a_reader_that_never_ends_is_ended(tmp_path: Path) -> None:
    # meshio's reader of Tecplot's files looks for a zone until it finds one.
    path = tmp_path / "endless.dat"
    path.write_text('VARIABLES = "X", "Y", "Z"\nZONE\n' + "DATAPACKING = BLOCK,\n" * 3)
    os.truncate(path, path.stat().st_size - 5)
    _refused(path, None, "meshio cannot read it as a mesh")


def test_a_file_that_asks_for_more_memory_than_there_is(tmp_path: Path) -> None:
    path = tmp_path / "huge.vtk"
    path.write_bytes(
        b"# vtk DataFile Version 4.2\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 99999999999 double\n\0\0"
    )
    _refused(path, None, "meshio cannot read it as a mesh")


def test_many_threads_read_at_once(stored: _Stored, small_heart: Mesh, tmp_path: Path, capsys) -> None:
    paths = [stored.write(tmp_path / "heart.vtu", surface=stored.tags), stored.gmsh(tmp_path / "heart.msh")]
    broken = tmp_path / "broken.msh"
    broken.write_bytes(b"no mesh")
    failures: list[BaseException] = []

    def read(path: Path) -> None:
        try:
            if path is broken:
                _refused(path, None, "meshio cannot read it")
            else:
                _same(read_mesh(path, _ALL), small_heart)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=read, args=(path,)) for path in [*paths, broken] * 3]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    print("standard output lives")
    assert capsys.readouterr().out == "standard output lives\n"


def _mutations(content: bytes) -> st.SearchStrategy[bytes]:
    def mutated(changes: list[tuple[int, bytes, int]]) -> bytes:
        changed = bytearray(content)
        for place, new, removed in changes:
            at = place % max(len(changed), 1)
            changed[at : at + removed] = new
        return bytes(changed)

    pieces = st.one_of(
        st.binary(max_size=8),
        st.sampled_from([b"-1", b"99999999999999999999", b"1e308", b"nan", b"9" * 5000, b"\n", b"$"]),
    )
    change = st.tuples(st.integers(0, 1 << 20), pieces, st.sampled_from([0, 1, 4, 8, 1000]))
    return st.lists(change, min_size=1, max_size=5).map(mutated)


@pytest.mark.parametrize("binary", [False, True])
def test_mutated_files_of_gmshs_format_are_read_or_refused(
    binary: bool, stored: _Stored, tmp_path: Path, small_heart: Mesh
) -> None:
    source = tmp_path / "sound.msh"
    write_mesh(small_heart, source)
    if binary:
        meshio.write(source, meshio.read(source), file_format="gmsh22", binary=True)
    path = tmp_path / "mutated.msh"

    @settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None, derandomize=True)
    @given(_mutations(source.read_bytes()))
    def check(content: bytes) -> None:
        path.write_bytes(content)
        try:
            mesh = read_mesh(path)
        except InvalidInput:
            return
        assert (mesh.volumes > 0.0).all()

    check()
    assert sorted(tmp_path.iterdir()) == [path, source]


_READERS: dict[str, Callable[[bytes], bytes]] = {
    "vtu": lambda content: content[:-200],
    "vtk": lambda content: content.replace(b"CELLS", b"CELL5"),
    "xdmf": lambda content: content.replace(b".h5:/", b".h5:/no"),
    "med": lambda content: content[: len(content) // 2],
    "mesh": lambda content: content.replace(b"Tetrahedra\n", b"Tetrahedra\n9"),
    "inp": lambda content: content.replace(b"*ELEMENT", b"*ELEMENT, TYPE=?", 1),
}


@pytest.mark.parametrize("ending", _READERS)
def test_damaged_files_of_other_formats_are_refused(ending: str, stored: _Stored, tmp_path: Path) -> None:
    array = {"med": "cell_tags", "mesh": "medit:ref"}.get(ending, "surface")
    path = stored.write(tmp_path / f"heart.{ending}", **{array: stored.tags})
    path.write_bytes(_READERS[ending](path.read_bytes()))
    _refused(path, _ALL)
