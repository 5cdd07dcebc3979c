"""gmsh's own format (.msh) of versions 2, 4.0 and 4.1, as text or binary: what gmsh itself writes, whole.

Read here and not by a library, because the readers there are keep one physical group of each entity, refuse files
with elements that are in none (Mesh.SaveAll) and partitioned ones, and trust every number in a file.
Source: the gmsh reference manual, MSH file format.
"""

import re
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from .stored import READ, StoredMesh, UnreadableMesh, by_number

#: How a file of this format begins, comments aside.
HEAD = b"$MeshFormat"

#: Kind, number of nodes and dimension of elements by gmsh's number for them.
_KINDS = {
    15: ("vertex", 1, 0),
    1: ("line", 2, 1),
    2: ("triangle", 3, 2),
    4: ("tetra", 4, 3),
    3: ("quad", 4, 2),
    5: ("hexahedron", 8, 3),
    6: ("wedge", 6, 3),
    7: ("pyramid", 5, 3),
    8: ("line of order 2", 3, 1),
    9: ("triangle of order 2", 6, 2),
    10: ("quad of order 2", 9, 2),
    11: ("tetra of order 2", 10, 3),
    12: ("hexahedron of order 2", 27, 3),
    13: ("wedge of order 2", 18, 3),
    14: ("pyramid of order 2", 14, 3),
    16: ("quad of order 2", 8, 2),
    17: ("hexahedron of order 2", 20, 3),
    18: ("wedge of order 2", 15, 3),
    19: ("pyramid of order 2", 13, 3),
    21: ("triangle of order 3", 10, 2),
    26: ("line of order 3", 4, 1),
    27: ("line of order 4", 5, 1),
    29: ("tetra of order 3", 20, 3),
    30: ("tetra of order 4", 35, 3),
}

#: Numbers above this are no longer exact as floats, and no mesh has as many of anything.
_LARGEST = 2**53

_PHYSICAL_NAME = re.compile(r'^\s*(\d{1,9})\s+(-?\d{1,12})\s+"(.*)"\s*$')
_SECTION = re.compile(rb"\$([A-Za-z]\w*)[ \t]*\r?\n")


def read_msh(content: bytes) -> StoredMesh:
    """The mesh in the `content` of a file; UnreadableMesh says what is wrong in it."""
    version, numbers, size_bytes, start = _head(content)
    if version in ("2", "2.0", "2.1", "2.2"):
        return _File(content, start, numbers, _Version2()).stored()
    if version == "4":
        # gmsh writes this for 4.0, other programs for 4.1.
        try:
            return _File(content, start, numbers, _Version4(0, size_bytes)).stored()
        except UnreadableMesh:
            return _File(content, start, numbers, _Version4(1, size_bytes)).stored()
    if version in ("4.0", "4.1"):
        return _File(content, start, numbers, _Version4(int(version[-1]), size_bytes)).stored()
    raise UnreadableMesh(f"is of version {version[:20]} of gmsh's format; save it as 4.1 (Mesh.MshFileVersion=4.1)")


def _head(content: bytes) -> tuple[str, "type[_Numbers]", int, int]:
    """Version, how numbers are written, bytes of a size, and where the sections begin."""
    line = content.find(b"\n", content.find(HEAD)) + 1
    end = content.find(b"\n", line)
    words = content[line:end].decode("ascii", "replace").split() if 0 < line < end else []
    after = content.find(b"$EndMeshFormat", end)
    if len(words) != 3 or words[1] not in ("0", "1") or words[2] not in ("4", "8") or after < 0:
        raise UnreadableMesh("has no valid section $MeshFormat; save it from gmsh again")
    numbers: type[_Numbers] = _Text
    if words[1] == "1":
        numbers = _LittleEndian if content[end + 1 : end + 5] == b"\1\0\0\0" else _BigEndian
    return words[0], numbers, int(words[2]), after + len(b"$EndMeshFormat")


class _Numbers(ABC):
    """The numbers of a section, one after the other."""

    def __init__(self, content: bytes, start: int, name: str) -> None:
        self._content, self.at, self._name = content, start, name

    @abstractmethod
    def rows(self, count: int, wholes: int, reals: int = 0, size: int = 4) -> tuple[IntArray, FloatArray]:
        """The next `count` rows, each of `wholes` whole numbers of `size` bytes followed by `reals` real ones."""

    @abstractmethod
    def count_on_its_line(self) -> int:
        """The next number, which is text in binary files too."""

    def whole(self, count: int, size: int = 4) -> IntArray:
        """The next `count` whole numbers."""
        return self.rows(1, count, 0, size)[0][0]

    def one(self, size: int = 4) -> int:
        """The next whole number, which counts something or names something."""
        return int(self.whole(1, size)[0])

    def real(self, count: int) -> FloatArray:
        """The next `count` real numbers."""
        return self.rows(1, 0, count)[1][0]

    def short(self) -> UnreadableMesh:
        """What to raise where the section does not hold what it should."""
        return UnreadableMesh(f"has no valid section ${self._name}, or ends within it; save it from gmsh again")


class _Text(_Numbers):
    def __init__(self, content: bytes, start: int, name: str) -> None:
        super().__init__(content, start, name)
        end = content.find(b"$End" + name.encode(), start)
        if end < 0:
            raise self.short()
        words = content[start:end].split()
        try:
            self._numbers = np.fromiter(map(float, words), np.float64, len(words))
        except ValueError:
            raise self.short() from None
        self.at, self._next = end, 0

    def rows(self, count: int, wholes: int, reals: int = 0, size: int = 4) -> tuple[IntArray, FloatArray]:
        width = wholes + reals
        if not 0 <= count * width <= len(self._numbers) - self._next or min(count, width) < 0:
            raise self.short()
        table = self._numbers[self._next : self._next + count * width].reshape(count, width)
        self._next += count * width
        whole = table[:, :wholes]
        if not (np.abs(whole) < _LARGEST).all() or (whole != np.rint(whole)).any():
            raise self.short()
        return whole.astype(np.int64), table[:, wholes:]

    def count_on_its_line(self) -> int:
        return self.one()

    def rest(self) -> IntArray:
        return self.whole(len(self._numbers) - self._next)


class _Binary(_Numbers):
    order = "="

    def rows(self, count: int, wholes: int, reals: int = 0, size: int = 4) -> tuple[IntArray, FloatArray]:
        bytes_per_row = size * wholes + 8 * reals
        if min(count, wholes, reals) < 0 or count * bytes_per_row > len(self._content) - self.at:
            raise self.short()
        number = f"{self.order}{'i' if size == 4 else 'u'}{size}"
        row = np.dtype([("whole", number, (wholes,)), ("real", f"{self.order}f8", (reals,))])
        if not bytes_per_row:
            return np.empty((count, 0), dtype=np.int64), np.empty((count, 0))
        table = np.frombuffer(self._content, row, count, self.at)
        self.at += count * bytes_per_row
        whole = table["whole"]
        if whole.size and whole.max() >= _LARGEST:
            raise self.short()
        return whole.astype(np.int64), table["real"].astype(np.float64)

    def count_on_its_line(self) -> int:
        end = self._content.find(b"\n", self.at)
        word = self._content[self.at : end].strip()
        if end < 0 or not word.isdigit() or len(word) > len(str(_LARGEST)):
            raise self.short()
        self.at = end + 1
        return int(word)


class _LittleEndian(_Binary):
    order = "<"


class _BigEndian(_Binary):
    order = ">"


class _Blocks:
    """The elements of a file, gathered block by block."""

    def __init__(self) -> None:
        self.nodes: dict[str, list[IntArray]] = {"triangle": [], "tetra": []}
        self.others: dict[str, int] = {}
        #: Which triangles are in the physical group of each number.
        self.groups: dict[int, list[IntArray]] = {}
        #: Which triangles lie on the geometrical entity of each number.
        self.entities: dict[int, list[IntArray]] = {}
        self.triangles = 0
        self.grouped_tetrahedra = 0

    def add(self, kind: int, nodes: IntArray, groups: dict[int, IntArray], entities: dict[int, IntArray]) -> None:
        """Elements of one kind, and which of them are in which groups and on which entities."""
        name, _, dimension = _KINDS[kind]
        if name not in READ:
            if dimension >= 2 and len(nodes):
                self.others[name] = self.others.get(name, 0) + len(nodes)
        elif name in self.nodes:
            self.nodes[name].append(nodes)
        if name == "triangle":
            for kept, found in ((self.groups, groups), (self.entities, entities)):
                for number, members in found.items():
                    kept.setdefault(number, []).append(self.triangles + members)
            self.triangles += len(nodes)
        elif name == "tetra" and groups:
            self.grouped_tetrahedra += len(np.unique(np.concatenate(list(groups.values()))))


def _nodes_of(kind: int) -> int:
    if kind not in _KINDS:
        raise UnreadableMesh(
            f"holds elements of gmsh's type {kind}, which are not linear tetrahedra; "
            "mesh the volume by tetrahedra, first order (Mesh.ElementOrder=1)"
        )
    return _KINDS[kind][1]


class _Version2:
    """Every element says which physical group it is in; one in several groups is listed as often."""

    def nodes(self, numbers: _Numbers) -> tuple[IntArray, FloatArray]:
        tags, points = numbers.rows(numbers.count_on_its_line(), 1, 3)
        return tags[:, 0], points

    def entities(self, numbers: _Numbers, partitioned: bool) -> None:
        """There are none in this version."""

    def elements(self, numbers: _Numbers, blocks: _Blocks) -> None:
        left = numbers.count_on_its_line()
        if isinstance(numbers, _Text):
            self._from_text(numbers, left, blocks)
            return
        while left > 0:
            kind, count, tags = numbers.whole(3).tolist()
            if count < 1 or tags < 0:
                raise numbers.short()
            self._add(numbers.rows(count, 1 + tags + _nodes_of(kind))[0], kind, tags, blocks)
            left -= count

    def _from_text(self, numbers: _Text, left: int, blocks: _Blocks) -> None:
        """Lines of different length: as many as are alike are taken at once."""
        values, at, window = numbers.rest(), 0, 8
        while left > 0:
            if at + 3 > len(values):
                raise numbers.short()
            kind, tags = values[at + 1 : at + 3].tolist()
            width = 3 + tags + _nodes_of(kind)
            count = min(window, left, (len(values) - at) // width if tags >= 0 else 0)
            if count < 1:
                raise numbers.short()
            table = values[at : at + count * width].reshape(count, width)
            alike = (table[:, 1] == kind) & (table[:, 2] == tags)
            window = 2 * window if alike.all() else 8
            count = count if alike.all() else int(alike.argmin())
            self._add(np.delete(table[:count], (1, 2), axis=1), kind, tags, blocks)
            at, left = at + count * width, left - count

    @staticmethod
    def _add(rows: IntArray, kind: int, tags: int, blocks: _Blocks) -> None:
        groups = by_number(np.abs(rows[:, 1])) if tags else {}
        groups.pop(0, None)
        entities = by_number(rows[:, 2]) if tags > 1 else {}
        blocks.add(kind, rows[:, 1 + tags :], groups, entities)


class _Version4:
    """Elements come by the geometrical entity they lie on, and the entity says which physical groups it is in."""

    def __init__(self, minor: int, size_bytes: int) -> None:
        self._minor, self._size = minor, size_bytes
        self._groups: dict[tuple[int, int], list[int]] = {}

    def entities(self, numbers: _Numbers, partitioned: bool) -> None:
        if partitioned:
            numbers.one(self._size)
            numbers.rows(numbers.one(self._size), 2)
        for dimension, count in enumerate(numbers.whole(4, self._size).tolist()):
            for _ in range(count):
                tag = numbers.one()
                if partitioned:
                    numbers.whole(2)
                    numbers.whole(numbers.one(self._size))
                numbers.real(3 if dimension == 0 and self._minor else 6)
                groups = numbers.whole(numbers.one(self._size))
                self._groups[dimension, tag] = np.unique(np.abs(groups)).tolist()
                if dimension:
                    numbers.whole(numbers.one(self._size))

    def nodes(self, numbers: _Numbers) -> tuple[IntArray, FloatArray]:
        blocks = int(numbers.whole(4 if self._minor else 2, self._size)[0])
        tags, points = [np.empty(0, dtype=np.int64)], [np.empty((0, 3))]
        for _ in range(blocks):
            dimension, entity, parametric = numbers.whole(3).tolist()
            if not self._minor:
                dimension, entity = entity, dimension
            count, coordinates = numbers.one(self._size), 3 + (dimension if parametric else 0)
            if not 0 <= dimension <= 3:
                raise numbers.short()
            if self._minor:
                tags.append(numbers.rows(count, 1, 0, self._size)[0][:, 0])
                points.append(numbers.rows(count, 0, coordinates)[1][:, :3])
            else:
                tag, place = numbers.rows(count, 1, coordinates)
                tags.append(tag[:, 0])
                points.append(place[:, :3])
        return np.concatenate(tags), np.concatenate(points)

    def elements(self, numbers: _Numbers, blocks: _Blocks) -> None:
        for _ in range(int(numbers.whole(4 if self._minor else 2, self._size)[0])):
            dimension, entity, kind = numbers.whole(3).tolist()
            if not self._minor:
                dimension, entity = entity, dimension
            count = numbers.one(self._size)
            rows, _ = numbers.rows(count, 1 + _nodes_of(kind), 0, self._size if self._minor else 4)
            groups = self._groups.get((dimension, entity), [])
            every = np.arange(count)
            blocks.add(kind, rows[:, 1:], dict.fromkeys(groups, every), {entity: every})


class _File:
    """The sections of a file, read in their order."""

    def __init__(self, content: bytes, start: int, numbers: type[_Numbers], version: _Version2 | _Version4) -> None:
        self._names: dict[tuple[int, int], str] = {}
        self._tags: IntArray | None = None
        self._points: FloatArray = np.empty((0, 3))
        self._blocks: _Blocks | None = None
        found = _SECTION.search(content, start)
        while found is not None:
            name = found[1].decode("ascii", "replace")
            at = found.end()
            if name == "PhysicalNames":
                self._name_groups(content, at)
            elif name in ("Entities", "PartitionedEntities", "Nodes", "Elements"):
                section = numbers(content, at, name)
                self._take(name, section, version)
                at = section.at
            end = content.find(b"$End" + found[1], at)
            if end < 0:
                raise UnreadableMesh(f"ends within ${name[:40]}; save it from gmsh again")
            found = _SECTION.search(content, end + len(found[1]) + 4)

    def _take(self, name: str, section: _Numbers, version: _Version2 | _Version4) -> None:
        if name == "Nodes":
            self._tags, self._points = version.nodes(section)
        elif name == "Elements":
            self._blocks = _Blocks()
            version.elements(section, self._blocks)
        else:
            version.entities(section, name == "PartitionedEntities")

    def _name_groups(self, content: bytes, at: int) -> None:
        end = content.find(b"$EndPhysicalNames", at)
        for line in content[at : max(end, at)].decode("utf-8", "replace").splitlines():
            found = _PHYSICAL_NAME.match(line)
            if found is not None:
                self._names[int(found[1]), abs(int(found[2]))] = found[3]

    def stored(self) -> StoredMesh:
        """What was read; UnreadableMesh where nodes or elements are missing."""
        blocks, tags = self._blocks, self._tags
        if blocks is None or tags is None:
            raise UnreadableMesh("lacks the section $Nodes or $Elements; save the mesh, not only the geometry")
        if len(np.unique(tags)) < len(tags):
            raise UnreadableMesh("gives two nodes the same number; save it from gmsh again")
        triangles = np.concatenate([np.empty((0, 3), dtype=np.int64), *blocks.nodes["triangle"]])
        tetrahedra = np.concatenate([np.empty((0, 4), dtype=np.int64), *blocks.nodes["tetra"]])
        groups = {number: np.concatenate(members) for number, members in blocks.groups.items()}
        entities = {number: np.concatenate(members) for number, members in blocks.entities.items()}
        named: dict[str, Any] = {}
        for (dimension, number), name in self._names.items():
            if dimension == 2:
                members = groups.get(number, np.empty(0, dtype=np.int64))
                named[name] = np.concatenate([named[name], members]) if name in named else members
        notes = []
        ungrouped = len(tetrahedra) - blocks.grouped_tetrahedra
        if blocks.grouped_tetrahedra and ungrouped > 0:
            notes.append(
                f"{ungrouped} of {len(tetrahedra)} tetrahedra are in no physical group and are taken as tissue too; "
                "save the mesh without them if they are not tissue (Mesh.SaveAll=0)"
            )
        return StoredMesh(
            self._points,
            _places(tags, tetrahedra),
            _places(tags, triangles),
            blocks.others,
            named,
            # Without physical groups gmsh saves everything, and the entities' numbers are all there is.
            {"physical group": groups} if groups else {"geometrical entity": entities} if entities else {},
            tuple(notes),
        )


def _places(tags: IntArray, wanted: IntArray) -> IntArray:
    """Where in `tags` each of `wanted` stands, −1 for those that are not there."""
    if not len(tags):
        return np.full_like(wanted, -1)
    order = np.argsort(tags, kind="stable")
    ordered = tags[order]
    place = np.searchsorted(ordered, wanted).clip(max=len(tags) - 1)
    return np.where(ordered[place] == wanted, order[place], -1)
