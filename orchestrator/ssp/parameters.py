"""The parameter values of a system package: its bindings, applied to components and connectors as the standard says.

Bindings of a system go before those of what is in it, later ones before earlier ones. What the standard lets a tool
ignore, a name that no variable has, is told; what is not supported is refused by its name.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from ..coupling.connections import Law
from ..errors import InputError, did_you_mean
from ..quoting import shortened
from .binding import Entry, entries
from .component import SystemComponent
from .connector import REAL, WHOLE, written
from .tree import Binding, SystemNode
from .unit_conversion import Measure, chained, conversion
from .wiring import Hop, Pin, Wiring

#: What is given to each component, by its name in the scenario.
Given = dict[str, dict[str, Any]]


def parameters(whole: SystemNode, wiring: Wiring, tell: Callable[[str], None]) -> Given:
    """All values for the variables of components; names that nobody has are told to `tell`."""
    bound = _Bound(wiring, tell)
    bound.take(whole)
    bound.pass_on()
    return bound.given


@dataclass(frozen=True)
class _Wanted:
    """What a value is for: a variable of a component, its type and unit of measure."""

    part: SystemComponent
    name: str

    @property
    def label(self) -> str:
        return f"{self.part.label}.{shortened(self.name)}"


class _Bound:
    """What the bindings give, inner ones first, so that outer ones replace them."""

    def __init__(self, wiring: Wiring, tell: Callable[[str], None]) -> None:
        self._wiring, self._tell = wiring, tell
        self.given: Given = {part.unit: {} for part in wiring.components.values()}
        self._at: dict[Pin, Entry] = {}

    def take(self, node: SystemNode) -> None:
        """Take the values of all that is in `node`, then its own."""
        for part in node.parts.values():
            if isinstance(part, SystemNode):
                self.take(part)
                continue
            own = (Binding(item, part.base) for item in part.bindings())
            for entry in entries(own, f"component '{part.label}'", part.package, self._tell, part.path):
                if not self._give(part, entry.name, entry):
                    self._tell(
                        f"component '{part.label}' has no variable '{shortened(entry.name)}'; its parameter value is "
                        "not used"
                    )
        for entry in entries(node.bindings, node.label, node.source.package, self._tell):
            if not self._spread(node, entry.name, entry):
                self._tell(f"no component has the variable '{shortened(entry.name)}'; its parameter value is not used")

    def pass_on(self) -> None:
        """Give what the connectors of systems have to the variables behind them."""
        used = set()
        for part, pin, hops in self._wiring.fed():
            if hops[0].source.path in self._wiring.components:
                continue
            # Of several the outermost, which is the first on the way.
            for number, hop in enumerate(hops):
                if hop.source in self._at:
                    used.add(hop.source)
                    wanted = _Wanted(part, pin.name)
                    self._keep(wanted, self._passed(hop.source, hops[number:], wanted))
                    break
        for pin in self._at.keys() - used:
            self._tell(f"the connector '{pin}' passes its parameter value to no component; it is not used")

    def _spread(self, node: SystemNode, name: str, entry: Entry) -> bool:
        """Give a value to all that has this hierarchical name in `node`; whether there is anything."""
        found = name in self._wiring.connectors_of(node)
        if found:
            self._at[Pin(node.path, name)] = entry
        for label, part in node.parts.items():
            rest = name.removeprefix(f"{label}.")
            if rest == name:
                continue
            if isinstance(part, SystemNode):
                found = self._spread(part, rest, entry) or found
            else:
                found = self._give(part, rest, entry) or found
        return found

    def _give(self, part: SystemComponent, name: str, entry: Entry) -> bool:
        if name not in part.variables:
            return False
        law = entry.law if entry.suppressed else chained(_converted(entry, part, name), entry.law)
        self._keep(_Wanted(part, name), _value(replace(entry, law=law), _Wanted(part, name)))
        return True

    def _keep(self, wanted: _Wanted, value: Any) -> None:
        """Keep a value for a component; of a structural parameter only the one that it has anyway."""
        variable = wanted.part.variables[wanted.name]
        if variable.causality != "structuralParameter":
            self.given[wanted.part.unit][wanted.name] = value
        elif f"{value:.17g}" != variable.start:
            raise InputError(
                f"'{wanted.label}' is a structural parameter, which keeps its start value {variable.start} here, but "
                f"the package gives {value}; remove that, or export the FMU with this size"
            )

    def _passed(self, pin: Pin, hops: Sequence[Hop], wanted: _Wanted) -> Any:
        """The value of the connector `pin` of a system, as it arrives."""
        entry, measure = self._at[pin], self._wiring.measure(pin)
        relative = wanted.part.is_relative(wanted.name)
        law = entry.law
        if not entry.suppressed and entry.unit is not None and measure is not None:
            law = chained(conversion(entry.unit, measure, relative), law)
        on_the_way = self._wiring.law(hops, measure or entry.unit, relative)
        return _value(replace(entry, law=chained(law, on_the_way)), wanted)


def _converted(entry: Entry, part: SystemComponent, name: str) -> Law | None:
    target: Measure | None = part.measure(name)
    if entry.unit is None or target is None:
        return None
    try:
        return conversion(entry.unit, target, part.is_relative(name))
    except InputError as error:
        raise InputError(f"parameter '{shortened(entry.name)}': {error}") from None


def _value(entry: Entry, wanted: _Wanted) -> Any:
    """The value in the type and unit of the variable: of an array a list, or one value that all elements have."""
    shape = wanted.part.variables[wanted.name].shape
    if entry.shape != shape:
        raise InputError(
            f"parameter '{shortened(entry.name)}' is {written(entry.shape)}, but '{wanted.label}' is {written(shape)}; "
            "correct its dimensions"
        )
    values = [_element(text, entry, wanted) for text in entry.texts]
    return values if len(set(values)) != 1 else values[0]


def _element(text: str, entry: Entry, wanted: _Wanted) -> Any:
    if entry.kind in REAL or (entry.kind in WHOLE and entry.law is not None):
        number = float(text)
        if entry.law is not None:
            number = entry.law.factor * number + entry.law.offset
        if not isfinite(number):
            raise InputError(f"parameter '{shortened(entry.name)}' is {number}; expected a finite number")
        return number
    if entry.law not in (None, Law()):
        raise InputError(
            f"parameter '{shortened(entry.name)}' is of the type {entry.kind}, which cannot be transformed linearly"
        )
    if entry.kind == "Enumeration":
        items = {name: number for number, name in wanted.part.variables[wanted.name].items.items()}
        if text not in items:
            raise InputError(
                f"'{wanted.label}' has no item '{shortened(text)}'"
                + (did_you_mean(text, items) if items else " (known: none, it is not an enumeration)")
            )
        return items[text]
    if entry.kind in WHOLE:
        return int(text)
    return text in ("true", "1") if entry.kind == "Boolean" else text
