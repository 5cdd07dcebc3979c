"""Who feeds whom in a system package: connections from connector to connector, followed through the systems between.

A connector of a system has two sides. From inside its inputs are sources, and its outputs are sinks; from outside, in
the system that it is in, it is the other way round, as for a component.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..coupling.connections import Law
from ..errors import InputError, did_you_mean
from ..quoting import shortened
from .component import SystemComponent
from .connector import Sizes, check_connector, sizes, unit_of
from .file import named, number
from .tree import SystemNode
from .unit_conversion import Measure, chained, conversion
from .vocabulary import NAMESPACES

_TRANSFORMATIONS = ("BooleanMappingTransformation", "IntegerMappingTransformation", "EnumerationMappingTransformation")

#: Kinds of connectors by which values come in, and by which they go out.
_IN, _OUT = ("input", "parameter"), ("output",)


@dataclass(frozen=True)
class Pin:
    """A connector: the path of the system or component that has it, and its name."""

    path: tuple[str, ...]
    name: str

    def __str__(self) -> str:
        return shortened(".".join((*self.path, self.name)))


@dataclass(frozen=True)
class Hop:
    """A connection that was followed: where it comes from, where it leads, and its element."""

    source: Pin
    target: Pin
    element: Any


class Wiring:
    """All connections of the system `whole`.

    Raises
    ------
    InputError
        For connectors that nobody has, kinds and types that cannot be coupled, connections that do not go from an
        output to an input or are of single elements of arrays, and two sources of one input.
    """

    def __init__(self, whole: SystemNode) -> None:
        self.systems = {node.path: node for node in whole.systems()}
        self.components = {part.place: part for part in whole.components()}
        self._connectors = {node.path: node.connectors for node in self.systems.values()}
        self._connectors |= {part.place: part.connectors for part in self.components.values()}
        self._feeding: dict[Pin, Hop] = {}
        for node in self.systems.values():
            for element in named(node.element, "ssd:Connections/ssd:Connection"):
                source, target = self._ends(node, element)
                if target in self._feeding:
                    raise InputError(f"the input {target} has more than one source; keep one of them")
                self._feeding[target] = Hop(source, target, element)

    def connectors_of(self, node: SystemNode) -> dict[str, Any]:
        """The connectors of a system by name."""
        return self._connectors[node.path]

    def is_fed(self, pin: Pin) -> bool:
        """Whether a connection leads to the connector."""
        return pin in self._feeding

    def fed(self) -> Iterator[tuple[SystemComponent, Pin, list[Hop]]]:
        """The connected inputs and parameters of components, with the connections that lead there from the source."""
        for pin in self._feeding:
            if pin.path in self.components:
                yield self.components[pin.path], pin, self._followed(pin)

    def law(self, hops: Sequence[Hop], current: Measure | None, relative: bool) -> Law | None:
        """What becomes of a value in the unit `current` on its way; None where nothing does."""
        law: Law | None = None
        for hop in hops:
            target = self.measure(hop.target)
            law = chained(law, _law(hop, current, target, relative))
            # A connector of a system that says no unit passes on what comes.
            current = target or current
        return law

    def measure(self, pin: Pin) -> Measure | None:
        """The unit of measure of a connector; that of a component's is its variable's."""
        if pin.path in self.components:
            return self.components[pin.path].measure(pin.name)
        unit = unit_of(self._connectors[pin.path][pin.name])
        return None if unit is None else self.systems[pin.path].source.measures.get(unit, Measure(unit))

    def sizes(self, pin: Pin) -> Sizes:
        """The dimensions that a connector of a system says; those that a parameter of the system gives are unknown."""
        return sizes(self._connectors[pin.path][pin.name], lambda _: None, f"connector '{pin}'")

    def _followed(self, pin: Pin) -> list[Hop]:
        hops: list[Hop] = []
        while pin in self._feeding:
            hop = self._feeding[pin]
            if hop in hops:
                raise InputError(f"the connections of {pin} form a circle through connectors of systems only")
            hops.append(hop)
            pin = hop.source
        return hops[::-1]

    def _ends(self, node: SystemNode, element: Any) -> tuple[Pin, Pin]:
        """Source and sink of a connection in the system `node`, whichever of them it starts with."""
        ends: dict[bool, Pin] = {}
        for side in ("start", "end"):
            label, name = _element(element, side), element.get(f"{side}Connector")
            if element.get(f"{side}Indices") is not None:
                raise InputError(
                    f"the connection of {_end(node, element, 'start')} to {_end(node, element, 'end')} has "
                    f"{side}Indices, and the standard does not say whether those count from 0 or 1; connect the whole "
                    "arrays"
                )
            if label is not None and label not in node.parts:
                raise InputError(
                    f"a connection names the component '{shortened(label)}'{did_you_mean(label, node.parts)}"
                )
            pin = Pin(node.path if label is None else (*node.path, label), name)
            connectors = self._connectors[pin.path]
            if name not in connectors:
                owner = node.label if label is None else f"component '{shortened('.'.join(pin.path))}'"
                raise InputError(f"{owner} has no connector '{shortened(name)}'{did_you_mean(name, connectors)}")
            kind = connectors[name].get("kind")
            if kind not in (*_IN, *_OUT):
                raise InputError(f"connector '{pin}' is of the kind {kind}; only outputs and inputs are exchanged")
            if pin.path in self.components:
                check_connector(self.components[pin.path], name, kind)
            # Seen from inside, the inputs of a system are where values come from.
            ends[(kind in _OUT) == (label is not None)] = pin
        if len(ends) != 2:
            raise InputError(
                f"the connection of {_end(node, element, 'start')} to {_end(node, element, 'end')} does not go from an "
                "output to an input"
            )
        return ends[True], ends[False]


def _element(element: Any, side: str) -> str | None:
    """The name of what has the connector; None for the system itself, for which some tools write an empty name."""
    return element.get(f"{side}Element") or None


def _end(node: SystemNode, element: Any, side: str) -> Pin:
    label = _element(element, side)
    return Pin(node.path if label is None else (*node.path, label), element.get(f"{side}Connector"))


def _law(hop: Hop, current: Measure | None, target: Measure | None, relative: bool) -> Law | None:
    """What becomes of a value on its way along one connection."""
    what = f"the connection to {hop.target}"
    for name in _TRANSFORMATIONS:
        if hop.element.find(f"ssc:{name}", NAMESPACES) is not None:
            raise InputError(f"{what} has a {name}; only linear ones are supported")
    own = linear_law(hop.element, what)
    if current is None or target is None:
        return own
    if hop.element.get("suppressUnitConversion", "false") in ("true", "1"):
        # Units that differ are meant: the law, though it may change nothing, says so.
        return own or (None if current.name == target.name else Law())
    try:
        return chained(conversion(current, target, relative), own)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None


def linear_law(element: Any, what: str) -> Law | None:
    """The linear transformation of a connection or a mapping, if it has one."""
    linear = element.find("ssc:LinearTransformation", NAMESPACES)
    return None if linear is None else Law(number(linear, "factor", 1.0, what), number(linear, "offset", 0.0, what))
