"""The parameter set of a component, an SSV file: parameters and start values by name, type and unit of measure."""

from typing import Any

from ...errors import InputError
from ...systems.system import REAL, Component, System, Value
from ..vocabulary import SSV, dimensions, version
from .measures import definitions, measured


def parameter_set(system: System, component: Component) -> Any:
    """The values of `component`; the sets of a system have one name, because Ecos is asked for all of them by that."""
    values = list(component.values())
    root = SSV.ParameterSet(
        {"version": version(system), "name": system.name},
        SSV.Parameters(*(_parameter(component, value) for value in values)),
    )
    root.extend(definitions(SSV, [(component, {value.unit for value in values if value.fmi_type in REAL})]))
    return root


def _parameter(component: Component, value: Value) -> Any:
    texts = value.texts
    if value.fmi_type == "Enumeration":
        texts = tuple(_item(component, value.name, text) for text in texts)
    if value.shape and value.fmi_type in ("String", "Enumeration"):
        typed = SSV(value.fmi_type, *(SSV.Value({"value": text}) for text in texts))
    else:
        unit = measured(component, value.unit) if value.fmi_type in REAL else {}
        # A text of blanks is a value too, that of a scalar; numbers of an array are a list.
        typed = SSV(value.fmi_type, {"value": " ".join(texts) if value.shape else value.text} | unit)
    return SSV.Parameter({"name": value.name}, typed, *dimensions(value.shape))


def _item(component: Component, name: str, number: str) -> str:
    """The name of an enumeration's item: a parameter set has names, where FMI has numbers."""
    items = {str(item.value): item.name for item in component.variables[name].declaredType.items}
    if number not in items:
        raise InputError(f"'{name}' of '{component.name}' has no item {number} (known: {', '.join(items)})")
    return str(items[number])
