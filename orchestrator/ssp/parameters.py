"""The parameter values of a system package: its bindings, applied to the components as SSP 1.0 says.

Bindings of the system go before those of components, later ones before earlier ones. What the standard lets a tool
ignore, a name that no variable has, is told; what is not supported is refused by its name.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from ...fmus.ssp import NAMESPACES
from ..errors import InputError
from .component import SystemComponent
from .file import check, inside, named, read
from .unit_conversion import Measure, conversion

_SET = "application/x-ssp-parameter-set"

#: What is given to each component, by its name in the scenario.
Given = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class _Entry:
    """A parameter as it stands in a set."""

    name: str
    kind: str
    text: str
    unit: Measure | None


def parameters(system: Any, parts: Sequence[SystemComponent], folder: Path, tell: Callable[[str], None]) -> Given:
    """All values for the variables of `parts`; names that nobody has are told to `tell`."""
    given: Given = {part.unit: {} for part in parts}
    for part in parts:
        for entry in _entries(part.element, folder, f"component '{part.label}'"):
            if entry.name in part.variables:
                given[part.unit][entry.name] = _value(entry, part, entry.name)
            else:
                tell(f"component '{part.label}' has no variable '{entry.name}'; its parameter value is not used")
    for entry in _entries(system, folder, "the system"):
        for part in parts:
            name = entry.name.removeprefix(f"{part.label}.")
            if name != entry.name and name in part.variables:
                given[part.unit][name] = _value(entry, part, name)
                break
        else:
            tell(f"no component has the variable '{entry.name}'; its parameter value is not used")
    return given


def _entries(owner: Any, folder: Path, what: str) -> Iterator[_Entry]:
    for binding in named(owner, "ssd:ParameterBindings/ssd:ParameterBinding"):
        if binding.find("ssd:ParameterMapping", NAMESPACES) is not None:
            raise InputError(
                f"a parameter binding of {what} has a ParameterMapping, which is not supported; rename the parameters"
            )
        if binding.get("type", _SET) != _SET:
            raise InputError(
                f"a parameter binding of {what} is of the type {binding.get('type')}, which is not supported"
            )
        if binding.get("sourceBase", "SSD") != "SSD":
            raise InputError(f"a parameter binding of {what} has its source inside an FMU, which is not supported")
        values, where = _set(binding, folder, what)
        units = {
            unit.get("name"): Measure.of(unit.get("name"), unit.find("ssc:BaseUnit", NAMESPACES))
            for unit in named(values, "ssv:Units/ssc:Unit")
        }
        for parameter in named(values, "ssv:Parameters/ssv:Parameter"):
            yield _entry(parameter, binding.get("prefix", ""), units, where)


def _set(binding: Any, folder: Path, what: str) -> tuple[Any, str]:
    """The parameter set of a binding, and where it stands."""
    source, inline = binding.get("source"), binding.find("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
    if (source is None) == (inline is None):
        raise InputError(f"a parameter binding of {what} needs either a source or a ParameterSet of its own")
    if inline is not None:
        check(inline, "ssv", f"the parameter set of {what}")
        return inline, f"the parameter set of {what}"
    path = inside(folder, source, f"a parameter set of {what}")
    return read(path, "ssv", unquote(source)), unquote(source)


def _entry(parameter: Any, prefix: str, units: dict[str, Measure], where: str) -> _Entry:
    name = prefix + parameter.get("name")
    value = next(child for child in parameter if child.tag != f"{{{NAMESPACES['ssc']}}}Annotations")
    kind, unit = value.tag.partition("}")[2], value.get("unit")
    if kind == "Binary":
        raise InputError(f"{where}: '{name}' is of the type Binary, which FMI 2.0 does not have")
    return _Entry(name, kind, value.get("value"), None if unit is None else units.get(unit, Measure(unit)))


def _value(entry: _Entry, part: SystemComponent, name: str) -> Any:
    """The value in the type and unit of the variable `name` of `part`."""
    variable = part.variables[name]
    if entry.kind == "Enumeration":
        items = (
            {}
            if variable.declaredType is None
            else {item.name: int(item.value) for item in variable.declaredType.items}
        )
        if entry.text not in items:
            known = ", ".join(items) or "none, it is no enumeration"
            raise InputError(f"'{part.label}.{name}' has no item '{entry.text}' (known: {known})")
        return items[entry.text]
    if entry.kind == "Integer":
        return int(entry.text)
    if entry.kind == "Boolean":
        return entry.text in ("true", "1")
    if entry.kind == "String":
        return entry.text
    number, target = float(entry.text), part.measure(name)
    if entry.unit is None or target is None:
        return number
    try:
        law = conversion(entry.unit, target, part.is_relative(name))
    except InputError as error:
        raise InputError(f"parameter '{entry.name}': {error}") from None
    return number if law is None else law.factor * number + law.offset
