"""The system of a package as a tree: systems in systems, at whose ends are components, FMUs all of them.

A component that refers to another system description, or to a package of its own, stands for the system in it, with
the component's connectors and parameter bindings (SSP 1.0.1, sections 5.3.1 and 5.4.3).
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from ..errors import InputError
from ..quoting import shortened
from .component import SystemComponent
from .file import inside, named, read, unpack
from .unit_conversion import Measure
from .vocabulary import NAMESPACES

_DEFINITION, _PACKAGE = "application/x-ssp-definition", "application/x-ssp-package"

#: Systems in systems, and of them all; a description that refers to itself would go on for ever.
_DEEPEST, _MOST_SYSTEMS = 20, 1000

#: Characters of a name in the scenario; files are called after it.
_LONGEST_NAME = 60


@dataclass(frozen=True)
class Source:
    """Where a description stands: the unpacked package, the folder in it that URIs are relative to, and its units."""

    package: Path
    base: Path
    measures: dict[str, Measure]

    @classmethod
    def of(cls, root: Any, base: Path, package: Path) -> "Source":
        """Of the system structure description `root` in the folder `base` of the unpacked `package`."""
        measures = {unit.get("name"): Measure.of_element(unit) for unit in named(root, "ssd:Units/ssc:Unit")}
        return cls(package, base, measures)


@dataclass(frozen=True)
class Binding:
    """A parameter binding, and the folder its URIs are relative to."""

    element: Any
    base: Path


@dataclass(frozen=True)
class SystemNode:
    """A system: its element, its path from the whole (which has none), and what is in it, by name."""

    element: Any
    path: tuple[str, ...]
    source: Source
    bindings: tuple[Binding, ...]
    parts: "dict[str, SystemNode | SystemComponent]" = field(default_factory=dict)

    @property
    def label(self) -> str:
        """The system, as messages call it."""
        return f"the system '{shortened('.'.join(self.path))}'" if self.path else "the system"

    @property
    def connectors(self) -> dict[str, Any]:
        """Its connectors by name."""
        return {item.get("name"): item for item in named(self.element, "ssd:Connectors/ssd:Connector")}

    def components(self) -> Iterator[SystemComponent]:
        """All components in it, at any depth, in their order."""
        for part in self.parts.values():
            if isinstance(part, SystemNode):
                yield from part.components()
            else:
                yield part

    def systems(self) -> "Iterator[SystemNode]":
        """It and all systems in it."""
        yield self
        for part in self.parts.values():
            if isinstance(part, SystemNode):
                yield from part.systems()


def tree(root: Any, package: Path) -> SystemNode:
    """The tree of the package unpacked in `package`, whose system structure description has the root `root`.

    Raises
    ------
    InputError
        For signal dictionaries, components that are no co-simulation FMUs, names that stand twice, and systems nested
        without an end.
    """
    whole = _Growth(package).system(next(named(root, "ssd:System")), (), Source.of(root, package, package))
    if next(whole.components(), None) is None:
        raise InputError("the system has no components, so there is nothing to run")
    return whole


class _Growth:
    """Makes the tree, and keeps the names that are taken."""

    def __init__(self, package: Path) -> None:
        self._package = package
        self._units: dict[str, tuple[str, ...]] = {}
        self._systems = 0
        self._packages = 0

    def system(
        self, element: Any, path: tuple[str, ...], source: Source, outer: tuple[Binding, ...] = ()
    ) -> SystemNode:
        """The system `element` and all in it; `outer` are the bindings of a component that refers to it."""
        self._systems += 1
        if len(path) > _DEEPEST or self._systems > _MOST_SYSTEMS:
            raise InputError(
                f"systems are nested more than {_DEEPEST} deep, or there are more than {_MOST_SYSTEMS}; look for a "
                f"description that refers to itself, at {shortened('.'.join(path))}"
            )
        own = tuple(Binding(item, source.base) for item in _bindings(element))
        node = SystemNode(element, path, source, (*own, *outer))
        for dictionary in named(element, "ssd:SignalDictionaries/ssd:SignalDictionary"):
            raise InputError(
                f"'{shortened(dictionary.get('name'))}' is a signal dictionary, which is not supported; connect the "
                "components directly"
            )
        for part in element.iterfind("ssd:Elements/*", NAMESPACES):
            label, kind = part.get("name"), part.tag.partition("}")[2]
            if kind == "SignalDictionaryReference":
                raise InputError(
                    f"'{shortened(label)}' is a signal dictionary, which is not supported; connect the components "
                    "directly"
                )
            if label in node.parts:
                raise InputError(f"{node.label} has two elements '{shortened(label)}'; rename one")
            place = (*path, label)
            if kind == "Component" and part.get("source") is None:
                raise InputError(
                    f"component '{shortened('.'.join(place))}' has no source, so it cannot be run; give it an FMU"
                )
            if kind == "System":
                node.parts[label] = self.system(part, place, source)
            elif part.get("type") in (_DEFINITION, _PACKAGE):
                node.parts[label] = self._referred(part, place, source)
            else:
                node.parts[label] = SystemComponent(part, self._unit(place), place, source.base, self._package)
        return node

    def _referred(self, element: Any, path: tuple[str, ...], source: Source) -> SystemNode:
        """The system in the description or package that the component `element` refers to."""
        what = f"the system of component '{shortened('.'.join(path))}'"
        file = inside(source.base, element.get("source"), what, self._package)
        try:
            if element.get("type") == _DEFINITION:
                base = file.parent
                root = read(file, "ssd", file.name)
            else:
                self._packages += 1
                if self._packages > _DEEPEST:
                    raise InputError(f"there are more than {_DEEPEST} packages nested in one another")
                base = self._package / f"package {self._packages} in it"
                base.mkdir()
                root = unpack(file, base)
        except InputError as error:
            raise InputError(f"{what}, {shortened(unquote(element.get('source')))}: {error}") from None
        outer = tuple(Binding(item, source.base) for item in _bindings(element))
        return self.system(next(named(root, "ssd:System")), path, Source.of(root, base, self._package), outer)

    def _unit(self, path: tuple[str, ...]) -> str:
        """The name of the component at `path` in the scenario, which no other has."""
        name = identifier("_".join(path))
        other = self._units.get(name)
        if other is not None and other[:-1] == path[:-1]:
            raise InputError(f"components '{other[-1]}' and '{path[-1]}' have too similar names; rename one")
        plain, number = name, 1
        # In different systems it is nobody's fault.
        while name in self._units:
            number += 1
            name = f"{plain}_{number}"
        self._units[name] = path
        return name


def identifier(name: str, allowed: str = "") -> str:
    """`name` as scenarios have names: begun by a letter, of letters, digits, '_' and what else is `allowed`."""
    plain = "".join(each if each.isalpha() or each.isdecimal() or each in allowed else "_" for each in name)
    plain = plain[:_LONGEST_NAME]
    return plain if re.match("[A-Za-z]", plain) else f"x{plain}"


def _bindings(element: Any) -> Iterator[Any]:
    return named(element, "ssd:ParameterBindings/ssd:ParameterBinding")
