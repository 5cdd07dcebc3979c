"""A connector against the variable of the FMU that it stands for: they have to agree in all that both say."""

from collections.abc import Callable
from functools import partial
from typing import Any

from ..errors import InputError
from ..quoting import shortened
from .component import SystemComponent
from .file import named
from .vocabulary import NAMESPACES

#: The types of connectors that real numbers have, and those of whole numbers (SSP 2.0, section on the type choice).
REAL = ("Real", "Float64", "Float32")
WHOLE = ("Integer", *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")))

#: The types that FMI 2.0 and 3.0 have two names for.
_SAME = {"Real": "Float64", "Integer": "Int32"}

#: Sizes of an array, None where one is not said.
Sizes = tuple[int | None, ...]


def unit_of(connector: Any) -> str | None:
    """The name of the unit of measure of a connector, if it has one."""
    kind = _type_of(connector)
    unit: str | None = None if kind is None else kind.get("unit")
    return unit


def sizes(connector: Any, size_of: Callable[[str], int | None], label: str) -> Sizes:
    """The sizes of a connector's dimensions, () if it says none; `size_of` is what another connector gives.

    InputError, which begins with `label`, for a dimension that is given twice.
    """
    found: list[int | None] = []
    for dimension in named(connector, "ssc:Dimension"):
        size, other = dimension.get("size"), dimension.get("sizeConnector")
        if size is not None and other is not None:
            raise InputError(f"{label} has a dimension with a size and a sizeConnector; keep one of them")
        found.append(int(size) if size is not None else None if other is None else size_of(other))
    return tuple(found)


def fits(shape: tuple[int, ...], said: Sizes) -> bool:
    """Whether an array of `shape` is of the sizes `said`."""
    return len(shape) == len(said) and all(size in (None, count) for count, size in zip(shape, said, strict=True))


def written(shape: Sizes) -> str:
    """A shape as messages have it."""
    return f"an array of {' × '.join('?' if size is None else str(size) for size in shape)}" if shape else "a scalar"


def check_connector(part: SystemComponent, name: str, kind: str) -> None:
    """InputError if the connector `name` of `part` is not what its FMU says, or nothing that is exchanged."""
    variable, connector = part.variables.get(name), part.connectors[name]
    label = f"connector '{part.label}.{shortened(name)}'"
    if variable is None or variable.causality != kind:
        raise InputError(f"{label} is of the kind {kind}, but the FMU {part.source} has no {kind} of that name")
    if kind != "parameter" and name not in part.pins:
        raise InputError(f"{label} is of the type {variable.type}, which is not exchanged")
    typed = _type_of(connector)
    shown_type = None if typed is None else typed.tag.partition("}")[2]
    if shown_type is not None and _SAME.get(shown_type, shown_type) != _SAME.get(variable.type, variable.type):
        raise InputError(
            f"{label} is of the type {shown_type}, but the FMU {part.source} says {variable.type}; give the connector "
            "the type of the variable"
        )
    shown, declared = unit_of(connector), part.measure(name)
    if shown is not None and declared is not None and shown != declared.name:
        raise InputError(
            f"{label} is in {shortened(shown)}, but the FMU {part.source} says {shortened(declared.name)}; "
            "give the connector the unit of the variable"
        )
    said = sizes(connector, partial(_size, part), label)
    # Without a word on it the FMU's variable decides, as it does for the type.
    if said and not fits(variable.shape, said):
        raise InputError(
            f"{label} is {written(said)}, but in the FMU {part.source} it is {written(variable.shape)}; give the "
            "connector the dimensions of the variable"
        )


def _type_of(connector: Any) -> Any:
    """The element for the type of a connector, the first of the common ones in it; None without one."""
    child = next(connector.iterchildren(f"{{{NAMESPACES['ssc']}}}*"), None)
    return None if child is None or child.tag.endswith("}Dimension") else child


def _size(part: SystemComponent, name: str) -> int | None:
    """The size that a structural parameter or a constant of the FMU gives to a dimension."""
    variable = part.variables.get(name)
    try:
        return None if variable is None or variable.start is None else int(variable.start)
    except ValueError:
        return None
