"""The values of a parameter binding: of its parameter set, by the names that its mapping gives them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from ..coupling.connections import Law
from ..errors import InputError
from ..quoting import shortened
from .connector import WHOLE, written
from .file import check, inside, member, named, parsed, read
from .tree import Binding
from .unit_conversion import Measure
from .vocabulary import NAMESPACES
from .wiring import linear_law

_SET, _MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"


@dataclass(frozen=True)
class Entry:
    """A parameter as it stands in a set: its name, its type, its value as text, and its unit of measure.

    An array has a text for each element, in row-major order of `shape`. `law` is what becomes of its values after any
    conversion of units, which is not done where it is `suppressed`.
    """

    name: str
    kind: str
    texts: tuple[str, ...]
    unit: Measure | None
    shape: tuple[int, ...] = ()
    law: Law | None = None
    suppressed: bool = False


def entries(
    bindings: Iterable[Binding], what: str, package: Path, tell: Callable[[str], None], fmu: Path | None = None
) -> Iterator[Entry]:
    """The values of `bindings` in their order, under the names that they are to be applied by.

    `what` has the bindings, a system or a component whose FMU is `fmu`; a mapped name that the set does not have is
    told to `tell`.
    """
    for binding in bindings:
        source = _Sources(binding, what, package, fmu)
        values, where = source.content(binding.element, "ssd:ParameterValues/ssv:ParameterSet", _SET, "ssv")
        units = {unit.get("name"): Measure.of_element(unit) for unit in named(values, "ssv:Units/ssc:Unit")}
        prefix = binding.element.get("prefix", "")
        found = [_entry(item, prefix, units, where) for item in named(values, "ssv:Parameters/ssv:Parameter")]
        mapping = next(named(binding.element, "ssd:ParameterMapping"), None)
        if mapping is None:
            yield from found
        else:
            yield from _mapped(source.content(mapping, "ssm:ParameterMapping", _MAPPING, "ssm"), found, tell)


class _Sources:
    """Where a binding finds its parameter set and its mapping."""

    def __init__(self, binding: Binding, what: str, package: Path, fmu: Path | None) -> None:
        self._base, self._what, self._package, self._fmu = binding.base, what, package, fmu

    def content(self, element: Any, inline: str, kind: str, schema: str) -> tuple[Any, str]:
        """The root of a parameter set or mapping, given in the `element` or by its source, and where it stands."""
        name = "parameter set" if schema == "ssv" else "parameter mapping"
        if element.get("type", kind) != kind:
            raise InputError(
                f"a parameter binding of {self._what} is of the type {shortened(element.get('type'))}, which is not "
                "supported"
            )
        source, here = element.get("source"), next(named(element, inline), None)
        if (source is None) == (here is None):
            own = "ParameterSet" if schema == "ssv" else "ParameterMapping"
            raise InputError(f"a parameter binding of {self._what} needs either a source or its own {own}")
        if here is not None:
            check(here, schema, f"the {name} of {self._what}")
            return here, f"the {name} of {self._what}"
        where = shortened(unquote(source))
        if element.get("sourceBase", "SSD") != "SSD":
            if self._fmu is None:
                raise InputError(
                    f"the {name} of {self._what} is declared to be inside an FMU (sourceBase), but does not belong to "
                    "one; refer to a file of the package (sourceBase SSD)"
                )
            return parsed(member(self._fmu, source, f"the {name} of {self._what}"), schema, where), where
        return read(inside(self._base, source, f"a {name} of {self._what}", self._package), schema, where), where


def _entry(parameter: Any, prefix: str, units: dict[str, Measure], where: str) -> Entry:
    name = prefix + parameter.get("name")
    value = next(parameter.iterchildren(f"{{{NAMESPACES['ssv']}}}*"))
    kind, unit = value.tag.partition("}")[2], value.get("unit")
    what = f"{where}: '{shortened(name)}'"
    if kind == "Binary":
        raise InputError(f"{what} is of the type Binary, which a scenario cannot express; leave it out")
    shape, texts = _shape(parameter, what), _texts(value, kind, what)
    if len(texts) != prod(shape):
        raise InputError(f"{what} has {len(texts)} values, but is {written(shape)}; correct its dimensions")
    measure = None if unit is None else units.get(unit, Measure(unit))
    return Entry(name, kind, texts, measure, shape)


def _shape(parameter: Any, what: str) -> tuple[int, ...]:
    """The dimensions of a parameter, whose sizes have to be numbers (SSP 2.0, section on dimensions)."""
    dimensions = list(named(parameter, "ssc:Dimension"))
    if any(each.get("size") is None or each.get("sizeConnector") is not None for each in dimensions):
        raise InputError(f"{what} has a dimension without its own size; a parameter set has to give all sizes")
    return tuple(int(each.get("size")) for each in dimensions)


def _texts(value: Any, kind: str, what: str) -> tuple[str, ...]:
    """The values of a parameter's elements; texts and items stand in one attribute, or each in an element."""
    text, elements = value.get("value"), [each.get("value") for each in named(value, "ssv:Value")]
    if (text is None) != bool(elements):
        raise InputError(f"{what} has either no value or two; give it an attribute `value` or elements Value")
    if text is None:
        return tuple(elements)
    return (text,) if kind in ("String", "Enumeration") else tuple(text.split())


def _mapped(mapping: tuple[Any, str], found: list[Entry], tell: Callable[[str], None]) -> Iterator[Entry]:
    """The entries that the mapping names, under the names that it gives them; the others are not applied."""
    root, where = mapping
    by_name = {entry.name: entry for entry in found}
    targets: set[str] = set()
    for item in named(root, "ssm:MappingEntry"):
        source, target = item.get("source"), item.get("target")
        if target in targets:
            raise InputError(f"{where}: several parameters are mapped to '{shortened(target)}'; keep one of them")
        targets.add(target)
        if source not in by_name:
            tell(f"{where}: the parameter set has no '{shortened(source)}' to be mapped")
            continue
        entry = by_name[source]
        what = f"{where}: the mapping of '{shortened(source)}'"
        yield replace(
            entry,
            name=target,
            texts=_looked_up(item, entry, what),
            law=linear_law(item, what),
            suppressed=item.get("suppressUnitConversion", "false") in ("true", "1"),
        )


def _looked_up(item: Any, entry: Entry, what: str) -> tuple[str, ...]:
    """The values by the table that the mapping may have for their type; those that it does not name are kept."""
    for kind in ("Boolean", "Integer", "Enumeration"):
        rows = list(named(item, f"ssc:{kind}MappingTransformation/ssc:MapEntry"))
        if not rows:
            continue
        if entry.kind != kind and not (kind == "Integer" and entry.kind in WHOLE):
            raise InputError(f"{what} has a table for the type {kind}, but it is of the type {entry.kind}")
        table = {_plain(row.get("source"), kind): row.get("target") for row in rows}
        return tuple(str(table.get(_plain(text, kind), text)) for text in entry.texts)
    return entry.texts


def _plain(text: str, kind: str) -> Any:
    """A value in a form that compares: +1 is 1, and 1 is true."""
    if kind == "Integer":
        return int(text)
    return text in ("true", "1") if kind == "Boolean" else text
