"""The connections of a system package, scalar by scalar, put together to those of whole fields."""

from collections.abc import Iterator, Sequence
from typing import Any

from ...fmus.ssp import NAMESPACES
from ..coupling.connections import Connection, End, Law
from ..errors import InputError, did_you_mean
from ..participants.participant import Port
from .component import SystemComponent
from .file import named
from .unit_conversion import chained, conversion

_TRANSFORMATIONS = ("BooleanMappingTransformation", "IntegerMappingTransformation", "EnumerationMappingTransformation")


def connections(system: Any, parts: Sequence[SystemComponent]) -> Iterator[Connection]:
    """The connections between fields.

    Raises
    ------
    InputError
        For connectors of the system itself, transformations other than linear ones, connectors and types that cannot
        be coupled, and fields that are connected in part only, or in another order.
    """
    fields: dict[tuple[End, End], tuple[Port, Port, dict[int, tuple[int, Law | None]]]] = {}
    for element in named(system, "ssd:Connections/ssd:Connection"):
        source, target = _ends(element, {part.label: part for part in parts})
        (output, at), (taken, place) = source[0].scalars[source[1]], target[0].scalars[target[1]]
        key = End(source[0].unit, output.name), End(target[0].unit, taken.name)
        places = fields.setdefault(key, (output, taken, {}))[2]
        if place in places:
            raise InputError(f"the input {target[0].label}.{target[1]} has more than one source; keep one of them")
        places[place] = (at, _law(element, source, target))
    for (start, end), (output, taken, places) in fields.items():
        laws = {law for _, law in places.values()}
        in_order = all(at == place for place, (at, _) in places.items())
        if output.shape != taken.shape or len(places) != taken.size or not in_order or len(laws) != 1:
            raise InputError(
                f"the connection {start} -> {end} is not of the whole field, element by element in the same way; "
                "arrays can only be connected as a whole"
            )
        yield Connection(start, end, laws.pop())


def _ends(
    element: Any, parts: dict[str, SystemComponent]
) -> tuple[tuple[SystemComponent, str], tuple[SystemComponent, str]]:
    """Output and input of a connection, whichever of them it starts with."""
    ends = {}
    for side in ("start", "end"):
        label, name = element.get(f"{side}Element"), element.get(f"{side}Connector")
        if label is None:
            raise InputError(
                f"connector '{name}' is one of the system itself; only connections from component to component are "
                "supported: connect the components directly, and give inputs from outside as parameter values"
            )
        if label not in parts:
            raise InputError(f"a connection names the component '{label}'{did_you_mean(label, parts)}")
        part = parts[label]
        if name not in part.connectors:
            raise InputError(f"component '{label}' has no connector '{name}'{did_you_mean(name, part.connectors)}")
        kind = part.connectors[name].get("kind")
        _check(part, name, kind)
        ends[kind] = (part, name)
    if len(ends) != 2:
        raise InputError(
            f"the connection of {element.get('startElement')}.{element.get('startConnector')} to "
            f"{element.get('endElement')}.{element.get('endConnector')} does not go from an output to an input"
        )
    return ends["output"], ends["input"]


def _check(part: SystemComponent, name: str, kind: str) -> None:
    """InputError if the connector cannot be coupled, or is not what its FMU says."""
    if kind not in ("input", "output"):
        raise InputError(
            f"connector '{part.label}.{name}' is of the kind {kind}; only outputs and inputs are exchanged"
        )
    variable = part.variables.get(name)
    if variable is None or variable.causality != kind:
        raise InputError(f"connector '{part.label}.{name}': the FMU {part.source} has no {kind} of that name")
    if name not in part.scalars:
        raise InputError(f"connector '{part.label}.{name}' is of the type {variable.type}; only Real is exchanged")
    real, declared = part.connectors[name].find("ssc:Real", NAMESPACES), part.measure(name)
    shown = None if real is None else real.get("unit")
    if shown is not None and declared is not None and shown != declared.name:
        raise InputError(
            f"connector '{part.label}.{name}' is in {shown}, but the FMU {part.source} says {declared.name}; "
            "give the connector the unit of the variable"
        )


def _law(element: Any, source: tuple[SystemComponent, str], target: tuple[SystemComponent, str]) -> Law | None:
    for name in _TRANSFORMATIONS:
        if element.find(f"ssc:{name}", NAMESPACES) is not None:
            raise InputError(
                f"the connection to {target[0].label}.{target[1]} has a {name}; only linear ones are supported"
            )
    linear = element.find("ssc:LinearTransformation", NAMESPACES)
    own = None if linear is None else Law(float(linear.get("factor", 1.0)), float(linear.get("offset", 0.0)))
    measures = source[0].measure(source[1]), target[0].measure(target[1])
    if measures[0] is None or measures[1] is None:
        return own
    if element.get("suppressUnitConversion", "false") in ("true", "1"):
        # Units that differ are meant: the law, though it may change nothing, says so.
        return own or (None if measures[0].name == measures[1].name else Law())
    try:
        return chained(conversion(measures[0], measures[1], source[0].is_relative(source[1])), own)
    except InputError as error:
        raise InputError(f"the connection to {target[0].label}.{target[1]}: {error}") from None
