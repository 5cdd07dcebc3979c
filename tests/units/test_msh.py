"""If these fail, what gmsh writes is read as another heart: groups lost, tissue doubled, or a sound file refused."""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.file import read_mesh
from cardiac_cosim.units.mesh.msh import read_msh
from cardiac_cosim.units.mesh.stored import UnreadableMesh
from cardiac_cosim.units.mesh.wall import wall_of


@pytest.fixture
def written(small_heart_file: Path, tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """The small heart as gmsh itself writes it: format, binary or not, partitions, and whatever is done to it."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)

    def write(version: float, binary: bool, parts: int = 0, save_all: bool = False, do: Any = None) -> Path:
        gmsh.clear()
        gmsh.open(str(small_heart_file))
        if do is not None:
            do()
        if parts:
            gmsh.model.mesh.partition(parts)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.option.setNumber("Mesh.SaveAll", save_all)
        path = tmp_path / f"{version} {binary} {parts} {save_all}.msh"
        gmsh.write(str(path))
        return path

    yield write
    gmsh.finalize()


def _described(mesh: Mesh) -> dict[str, Any]:
    """Everything of a mesh that does not depend on the order of nodes, elements and faces."""
    places = [tuple(place) for place in np.round(mesh.points, 9).tolist()]
    return {
        "points": sorted(places),
        "cells": sorted(sorted(places[node] for node in cell) for cell in mesh.cells.tolist()),
        "boundaries": {
            name: sorted(sorted(places[node] for node in face) for face in faces.tolist())
            for name, faces in mesh.boundaries.items()
        },
    }


#: What gmsh writes: 4.0 as text only.
_FORMATS = [(2.2, False), (2.2, True), (4.0, False), (4.1, False), (4.1, True)]


@pytest.mark.parametrize("parts", [0, 3])
@pytest.mark.parametrize(("version", "binary"), _FORMATS)
def test_every_version_holds_the_same_heart(
    version: float, binary: bool, parts: int, written: Callable[..., Path], small_heart: Mesh
) -> None:
    mesh = read_mesh(written(version, binary, parts))
    assert _described(mesh) == _described(small_heart)
    assert mesh.notes == ()


def test_save_all_of_version_2_loses_the_groups_and_the_remedy_is_named(written: Callable[..., Path]) -> None:
    with pytest.raises(InvalidInput, match=r"no triangles in 'base', .*Mesh\.SaveAll=0"):
        read_mesh(written(2.2, False, save_all=True))


@pytest.mark.parametrize("version", [4.0, 4.1])
def test_elements_in_no_group_do_no_harm(version: float, written: Callable[..., Path], small_heart: Mesh) -> None:
    # Mesh.SaveAll, with a curve and a surface that are in no physical group.
    def add() -> None:
        line = gmsh.model.addDiscreteEntity(1)
        gmsh.model.mesh.addNodes(1, line, [10001, 10002], [0, 0, 5, 0, 0, 6])
        gmsh.model.mesh.addElementsByType(line, 1, [], [10001, 10002])
        nodes = small_heart.boundary("base")[0] + 1
        gmsh.model.mesh.addElementsByType(gmsh.model.addDiscreteEntity(2), 2, [], nodes.tolist())

    mesh = read_mesh(written(version, False, save_all=True, do=add))
    assert _described(mesh) == _described(small_heart)
    assert mesh.notes == ("2 of 273 nodes belong to no tetrahedron and were left out",)


@pytest.mark.parametrize(("version", "binary"), _FORMATS)
def test_an_entity_in_two_groups_is_in_both(
    version: float, binary: bool, written: Callable[..., Path], small_heart: Mesh
) -> None:
    def group() -> None:
        inner = [
            tag for name in ("lv_endocardium", "rv_endocardium") for tag in gmsh.model.getEntitiesForPhysicalName(name)
        ]
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in inner], name="chambers")
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="active")

    mesh = read_mesh(written(version, binary, do=group))
    expected = _described(small_heart)
    described = _described(mesh)
    both = expected["boundaries"]["lv_endocardium"] + expected["boundaries"]["rv_endocardium"]
    assert described["boundaries"].pop("chambers") == sorted(both)
    assert described == expected
    doubled = "845 of 1690 tetrahedra are listed twice, as happens where volume groups overlap; each was taken once"
    assert mesh.notes == ((doubled,) if version == 2.2 else ())
    assert wall_of(mesh).cavities


def test_one_name_for_a_surface_and_a_volume(written: Callable[..., Path], small_heart: Mesh) -> None:
    def name() -> None:
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="epicardium")

    assert _described(read_mesh(written(4.1, False, do=name))) == _described(small_heart)


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_without_groups_the_entities_numbers_name_the_boundaries(
    version: float, written: Callable[..., Path], small_heart: Mesh
) -> None:
    def forget() -> None:
        gmsh.model.removePhysicalGroups()
        for name in (*small_heart.boundaries, "myocardium"):
            gmsh.model.removePhysicalName(name)

    path = written(version, False, do=forget)
    with pytest.raises(InvalidInput, match=r"no named boundaries.*'geometrical entity': 1, 2, 3, 4, 5"):
        read_mesh(path)
    naming = {name: [number] for number, name in enumerate(small_heart.boundaries, start=1)}
    assert _described(read_mesh(path, naming)) == _described(small_heart)


def test_tetrahedra_outside_of_all_groups_are_told(written: Callable[..., Path]) -> None:
    def regroup() -> None:
        _, tags, nodes = gmsh.model.mesh.getElements(3)
        apart = gmsh.model.addDiscreteEntity(3)
        gmsh.model.mesh.addElementsByType(apart, 4, [], nodes[0][:40])
        gmsh.model.mesh.removeElements(3, gmsh.model.getEntities(3)[0][1], tags[0][:10])

    mesh = read_mesh(written(4.1, False, save_all=True, do=regroup))
    assert mesh.elements == 845
    assert mesh.notes[0].startswith("10 of 845 tetrahedra are in no physical group and are taken as tissue too")


def test_big_endian_files_are_read(written: Callable[..., Path], small_heart: Mesh) -> None:
    """A file of version 2.2 with all its numbers turned round, as a machine of the other byte order writes it."""
    content = written(2.2, True).read_bytes()
    head, nodes = content.split(b"$Nodes\n")
    count, rest = nodes.split(b"\n", 1)
    rows, size = int(count), 4 + 24
    table, after = rest[: rows * size], rest[rows * size :]
    turned = b"".join(
        struct.pack(">i3d", *struct.unpack("<i3d", table[at : at + size])) for at in range(0, len(table), size)
    )
    middle, elements = after.split(b"$Elements\n")
    total, body = elements.split(b"\n", 1)
    values = body[: body.index(b"\n$EndElements")]
    other = np.frombuffer(values[: len(values) // 4 * 4], "<i4").astype(">i4").tobytes()
    path = written(2.2, True)
    path.write_bytes(
        head.replace(b"\1\0\0\0", b"\0\0\0\1")
        + b"$Nodes\n"
        + count
        + b"\n"
        + turned
        + middle
        + b"$Elements\n"
        + total
        + b"\n"
        + other
        + b"\n$EndElements\n"
    )
    assert _described(read_mesh(path)) == _described(small_heart)


@pytest.mark.parametrize("kind", ["hexahedron", "prism", "tetrahedron of order 2", "quad"])
def test_other_cells_are_refused_by_kind_and_number(kind: str, written: Callable[..., Path]) -> None:
    number, nodes, said = {
        "hexahedron": (5, 8, "2 hexahedron"),
        "prism": (6, 6, "2 wedge"),
        "tetrahedron of order 2": (11, 10, "2 tetra of order 2"),
        "quad": (3, 4, "2 quad"),
    }[kind]

    def add() -> None:
        volume = gmsh.model.addDiscreteEntity(2 if kind == "quad" else 3)
        gmsh.model.mesh.addElementsByType(volume, number, [], list(range(1, 2 * nodes + 1)))

    with pytest.raises(InvalidInput, match=rf"other than linear tetrahedra and triangles \({said}\).*ElementOrder=1"):
        read_mesh(written(4.1, False, save_all=True, do=add))


def test_a_version_that_is_none_of_gmshs_is_named() -> None:
    with pytest.raises(UnreadableMesh, match=r"version 3\.7 of gmsh's format; save it as 4\.1"):
        read_msh(b"$MeshFormat\n3.7 0 8\n$EndMeshFormat\n")
