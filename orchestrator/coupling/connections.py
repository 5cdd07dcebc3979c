"""Who feeds whom: the connections of a scenario, written out or found by name, and checked."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite
from typing import Any

import numpy as np

from ..errors import InputError, did_you_mean
from ..participants.participant import Participant, Port, Ports, Ramp, Values
from ..quoting import shortened
from ..scenario import ConnectionEntry

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LAW = re.compile(rf"(?:\s+\*\s+(?P<factor>{_NUMBER}))?(?:\s+(?P<sign>[+-])\s+(?P<offset>{_NUMBER}))?$")
_UNIT = re.compile(r"^\w+\.")

#: Names that are read as they are written in 'unit.output * 2 -> unit.input'; any other is told as an entry.
_PLAIN = re.compile(r"^(?!.*(?:->|\s[*+-]\s))\S(?:[^\x00-\x1f\x7f]*\S)?$")

#: Arrows in one text that may be the one that is meant, and characters of it that a message repeats.
_MOST_ARROWS, _LONGEST = 20, 200

#: Types whose values can become those of another type, beside those that are the same.
_WHOLE = {"Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))}
_REAL = {"Real", "Float32"}


@dataclass(frozen=True)
class End:
    """One end of a connection: a variable of a unit."""

    unit: str
    name: str

    def __str__(self) -> str:
        return f"{self.unit}.{self.name}"


@dataclass(frozen=True)
class Law:
    """What becomes of a value on its way: factor · value + offset."""

    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input, by a law where one is written: then units of measure are the writer's affair."""

    source: End
    target: End
    law: Law | None = None

    def __str__(self) -> str:
        """As it is written in a scenario, whatever the names are."""
        if not (_PLAIN.match(self.source.name) and _PLAIN.match(self.target.name)):
            return json.dumps(self.entry(), ensure_ascii=False)
        law = "" if self.law is None else f" * {self.law.factor!r} + {self.law.offset!r}"
        return f"{self.source}{law} -> {self.target}"

    def entry(self) -> dict[str, Any]:
        """As a structured entry of a scenario, in which no name has to be told from what is around it."""
        ends = {"from": self.source.unit, "output": self.source.name, "to": self.target.unit, "input": self.target.name}
        law = {} if self.law is None else {"factor": self.law.factor, "offset": self.law.offset}
        return ends | law

    def carried(self, values: Values) -> Values:
        """What arrives at the input of the output's `values`."""
        return values if self.law is None else self.law.factor * values + self.law.offset

    def ramped(self, ramp: Ramp) -> Ramp:
        """What arrives of an output's `ramp`."""
        if self.law is None:
            return ramp
        curvature = None if ramp.curvature is None else self.law.factor * ramp.curvature
        return Ramp(self.carried(ramp.begin), self.carried(ramp.end), curvature)


def connect(
    participants: Mapping[str, Participant], written: Sequence[str | ConnectionEntry], by_name: bool = True
) -> tuple[Connection, ...]:
    """The connections as written, and, if `by_name`, for every other live input the one live output of its name.

    An input that nothing feeds keeps its start value, and so does an element of an array.

    Raises
    ------
    InputError
        For a connection that cannot be read, an unknown unit or variable, two sources of one input, a name that
        several outputs have, and for types, shapes or units of measure that do not go together.
    """
    connections = [
        _parse(item, participants) if isinstance(item, str) else _of_entry(item, participants) for item in written
    ]
    # Inputs, and the arrays of inputs that are elements.
    fed: set[End] = set()
    parts: set[End] = set()
    for connection in connections:
        target = connection.target
        whole = _whole(target, participants)
        if target in fed | parts or whole in fed:
            raise InputError(f"connections: the input {target} has more than one source; keep one of them")
        fed.add(target)
        if whole != target:
            parts.add(whole)
    for unit, participant in participants.items() if by_name else ():
        for port in participant.inputs.values():
            target = End(unit, port.name)
            if not port.live or target in fed | parts:
                continue
            sources = [
                End(name, port.name)
                for name, other in participants.items()
                if port.name in other.outputs and other.outputs[port.name].live
            ]
            if len(sources) > 1:
                choice = " or ".join(f"'{Connection(source, target)}'" for source in sources)
                raise InputError(f"connections: several outputs are named {port.name}; write {choice}")
            connections += [Connection(source, target) for source in sources]
    for connection in connections:
        _check(
            connection,
            participants[connection.source.unit].outputs[connection.source.name],
            participants[connection.target.unit].inputs[connection.target.name],
        )
    return tuple(connections)


def _whole(target: End, participants: Mapping[str, Participant]) -> End:
    """The array that an input is an element of; itself where it is none."""
    inputs = participants[target.unit].inputs
    place = None if target.name in inputs else inputs.place(target.name)
    return target if place is None else End(target.unit, place[0].name)


def _parse(text: str, participants: Mapping[str, Participant]) -> Connection:
    """The one way to read `text` by which both its ends exist."""
    found: list[Connection] = []
    for arrow in islice(re.finditer("->", text), _MOST_ARROWS):
        sources = list(_sources(text[: arrow.start()].strip(), participants))
        target = _end(text[arrow.end() :].strip())
        if target is not None and _exists(target, participants, "input"):
            found += [Connection(source, target, law) for source, law in sources]
    if len(found) == 1:
        return found[0]
    if found:
        ways = " or ".join(json.dumps(way.entry(), ensure_ascii=False) for way in found)
        shown = shortened(text, _LONGEST)
        raise InputError(f"connections: '{shown}' can be read in several ways; write it as an entry, {ways}")
    raise InputError(f"connections: {_unreadable(text, participants)}")


def _sources(text: str, participants: Mapping[str, Participant]) -> Iterator[tuple[End, Law | None]]:
    """The outputs that `text` can name, with their laws: what looks like a law may be a part of the name."""
    end, (named, law) = _end(text), _split(text)
    if end is not None and _exists(end, participants, "output"):
        yield end, None
    if law is not None and (end := _end(named)) is not None and _exists(end, participants, "output"):
        yield end, law


def _split(text: str) -> tuple[str, Law | None]:
    """An output with a law: what names the output, and the law."""
    match = _LAW.search(text)
    if match is None or not match[0]:
        return text, None
    factor, offset = float(match["factor"] or 1.0), float(match["offset"] or 0.0)
    if not (isfinite(factor) and isfinite(offset)):
        raise InputError(f"connections: '{shortened(text)}': the numbers of a law have to be finite")
    return text[: match.start()].rstrip(), Law(factor, -offset if match["sign"] == "-" else offset)


def _end(text: str) -> End | None:
    """Names of units have no dots; those of variables may have any."""
    unit, _, name = text.partition(".")
    return End(unit, name) if _UNIT.match(text) and name else None


def _exists(end: End, participants: Mapping[str, Participant], side: str) -> bool:
    return end.unit in participants and _ports(participants[end.unit], side).known(end.name)


def _ports(participant: Participant, side: str) -> Ports:
    return participant.outputs if side == "output" else participant.inputs


def _unreadable(text: str, participants: Mapping[str, Participant]) -> str:
    """What is wrong with a connection that cannot be read, or whose ends do not exist."""
    before, arrow, after = text.partition("->")
    source, target = _end(_split(before.strip())[0]), _end(after.strip())
    wild = source is None or target is None or "->" in after or re.search(r"\s[*+-](\s|$)", source.name)
    if not arrow or source is None or target is None or (wild and _missing(source, participants, "output")):
        return (
            f"'{shortened(text, _LONGEST)}' cannot be read; write it as 'unit.output -> unit.input', "
            "or with a law, 'unit.output * 0.001 + 273 -> unit.input'"
        )
    problem = _missing(source, participants, "output") or _missing(target, participants, "input")
    return f"'{shortened(text, _LONGEST)}': {problem}"


def _missing(end: End, participants: Mapping[str, Participant], side: str) -> str | None:
    """What of an end does not exist."""
    if end.unit not in participants:
        return f"unknown unit '{end.unit}'{did_you_mean(end.unit, participants)}"
    known = _ports(participants[end.unit], side)
    if known.known(end.name):
        return None
    return f"unit '{end.unit}' has no {side} '{end.name}'{_other_side(end, participants, side)}"


def _other_side(end: End, participants: Mapping[str, Participant], side: str) -> str:
    """What the name may be instead."""
    participant = participants[end.unit]
    known, other = _ports(participant, side), "input" if side == "output" else "output"
    array = next((port for port in known.values() if end.name.startswith(f"{port.name}[") and port.shape), None)
    if array is not None:
        names = list(array.elements)
        return f"; the array {array.name} has the elements {names[0]} to {names[-1]}"
    hint = did_you_mean(end.name, known)
    if _ports(participant, other).known(end.name):
        return f" (it is an {other}){hint}"
    return hint


def _of_entry(entry: ConnectionEntry, participants: Mapping[str, Participant]) -> Connection:
    source, target = End(entry.source, entry.output), End(entry.target, entry.input)
    connection = Connection(source, target, entry.law and Law(*entry.law))
    problem = _missing(source, participants, "output") or _missing(target, participants, "input")
    if problem is not None:
        raise InputError(f"connections: {json.dumps(connection.entry(), ensure_ascii=False)}: {problem}")
    return connection


def _check(connection: Connection, source: Port, target: Port) -> None:
    if not _converts(source.type, target.type):
        raise InputError(
            f"connections: '{connection}': the types differ, {source.type} -> {target.type}, and the first cannot "
            "be converted to the second; connect another output, or change the type in one of the FMUs"
        )
    if connection.law is not None and not target.is_real:
        raise InputError(
            f"connections: '{connection}': a law gives real numbers, but the input is of the type {target.type}; "
            "leave the law out"
        )
    if source.shape != target.shape and (source.size, target.size) != (1, 1):
        raise InputError(
            f"connections: '{connection}': the shapes differ, {source.shape} -> {target.shape}; both units have to be "
            f"built for the same mesh, or write which elements, '{_element(connection, source, target)}'"
        )
    if connection.law is None and None not in (source.unit, target.unit) and source.unit != target.unit:
        raise InputError(
            f"connections: '{connection}': the units of measure differ, {source.unit} -> {target.unit}; "
            f"write the conversion, '{connection.source} * <factor> -> {connection.target}'"
        )


def _converts(source: str, target: str) -> bool:
    """Whether values of one type have a meaning as those of another."""
    if source == target or (source in _REAL and target in _REAL):
        return True
    if source in _WHOLE:
        return target in _WHOLE or target in _REAL or target == "Enumeration"
    if source == "Enumeration":
        return target in _WHOLE
    return source == "Boolean" and (target in _REAL or target in _WHOLE)


def _element(connection: Connection, source: Port, target: Port) -> Connection:
    """The connection of the first elements."""
    ends = End(connection.source.unit, next(source.elements)), End(connection.target.unit, next(target.elements))
    return Connection(*ends, connection.law)


def fitted(values: Values, port: Port) -> Values:
    """`values` of an output as those of the input `port`: of its shape, and real numbers if it takes such."""
    shaped = values if values.shape == port.shape else values.reshape(port.shape)
    return shaped if not port.is_real or shaped.dtype.kind == "f" else shaped.astype(np.float64)
