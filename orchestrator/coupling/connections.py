"""Who feeds whom: the connections of a scenario, written out or found by name, and checked."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..errors import InputError, did_you_mean
from ..participants.participant import Participant, Port, Ramp, Values

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
# Variables of foreign FMUs have dots, brackets and signs in their names, `arm.joint.phi`, `der(x)`, but no spaces.
_ARROW = re.compile(
    r"^\s*(?P<source>\w+)\.(?P<output>\S+?)"
    rf"(?P<law>(?:\s+\*\s+(?P<factor>{_NUMBER}))?(?:\s+(?P<sign>[+-])\s+(?P<offset>{_NUMBER}))?)"
    r"\s*->\s*(?P<target>\w+)\.(?P<input>\S+)\s*$"
)


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
        law = "" if self.law is None else f" * {self.law.factor!r} + {self.law.offset!r}"
        return f"{self.source}{law} -> {self.target}"

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
    participants: Mapping[str, Participant], written: Sequence[str], by_name: bool = True
) -> tuple[Connection, ...]:
    """The connections as written, and, if `by_name`, for every other live input the one output of its name.

    An input that nothing feeds keeps its start value.

    Raises
    ------
    InputError
        For a connection that cannot be read, an unknown unit or variable, two sources of one input, a name that
        several outputs have, and for shapes or units of measure that differ.
    """
    connections = [_parse(text, participants) for text in written]
    fed = [connection.target for connection in connections]
    for target in fed:
        if fed.count(target) > 1:
            raise InputError(f"connections: the input {target} has more than one source; keep one of them")
    for unit, participant in participants.items() if by_name else ():
        for port in participant.inputs.values():
            target = End(unit, port.name)
            if target in fed or not port.live:
                continue
            sources = [End(name, port.name) for name, other in participants.items() if port.name in other.outputs]
            if len(sources) > 1:
                choice = " or ".join(f"'{source} -> {target}'" for source in sources)
                raise InputError(f"connections: several outputs are named {port.name}; write {choice}")
            connections += [Connection(source, target) for source in sources]
    for connection in connections:
        _check(
            connection,
            participants[connection.source.unit].outputs[connection.source.name],
            participants[connection.target.unit].inputs[connection.target.name],
        )
    return tuple(connections)


def _parse(text: str, participants: Mapping[str, Participant]) -> Connection:
    match = _ARROW.match(text)
    if match is None:
        raise InputError(
            f"connections: '{text}' cannot be read; write it as 'unit.output -> unit.input', "
            "or with a law, 'unit.output * 0.001 + 273 -> unit.input'"
        )
    source, target = End(match["source"], match["output"]), End(match["target"], match["input"])
    for end, side in ((source, "output"), (target, "input")):
        if end.unit not in participants:
            raise InputError(f"connections: '{text}': unknown unit '{end.unit}'{did_you_mean(end.unit, participants)}")
        ports = participants[end.unit].outputs if side == "output" else participants[end.unit].inputs
        if end.name not in ports:
            hint = did_you_mean(end.name, ports)
            raise InputError(f"connections: '{text}': unit '{end.unit}' has no {side} '{end.name}'{hint}")
    return Connection(source, target, _law(match) if match["law"] else None)


def _law(match: re.Match[str]) -> Law:
    factor, offset = float(match["factor"] or 1.0), float(match["offset"] or 0.0)
    return Law(factor, -offset if match["sign"] == "-" else offset)


def _check(connection: Connection, source: Port, target: Port) -> None:
    if source.shape != target.shape:
        raise InputError(
            f"connections: '{connection}': the shapes differ, {source.shape} -> {target.shape}; "
            "both units have to be built for the same mesh"
        )
    if connection.law is None and None not in (source.unit, target.unit) and source.unit != target.unit:
        raise InputError(
            f"connections: '{connection}': the units of measure differ, {source.unit} -> {target.unit}; "
            f"write the conversion, '{connection.source} * <factor> -> {connection.target}'"
        )
