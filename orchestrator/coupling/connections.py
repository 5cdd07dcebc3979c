"""Who feeds whom: the connections of a scenario, written out or found by name, and checked."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import networkx as nx

from ..errors import InputError, did_you_mean
from ..participants.participant import Participant, Port

# Variables of foreign FMUs have dots and brackets in their names: `arm.joint.phi`, `der(x)`.
_ARROW = re.compile(r"^\s*(\w+)\.(\S+?)\s*->\s*(\w+)\.(\S+)\s*$")


@dataclass(frozen=True)
class End:
    """One end of a connection: a variable of a unit."""

    unit: str
    name: str

    def __str__(self) -> str:
        return f"{self.unit}.{self.name}"


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input."""

    source: End
    target: End

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


def connect(participants: Mapping[str, Participant], written: Sequence[str]) -> tuple[Connection, ...]:
    """The connections as written, and for every other live input the one output of its name.

    An input that no output is named after keeps its start value.

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
    for unit, participant in participants.items():
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


def initial_order(units: Iterable[str], connections: Iterable[Connection]) -> list[str]:
    """An order in which units can be initialised: each after those that feed it, as far as loops allow.

    Inside a loop the given order of the units decides, and the inputs that close it start at their start values.
    """
    order = list(units)
    graph = nx.DiGraph()
    graph.add_nodes_from(order)
    graph.add_edges_from((link.source.unit, link.target.unit) for link in connections)
    loops = nx.condensation(graph)
    position = {unit: number for number, unit in enumerate(order)}
    sequence = nx.lexicographical_topological_sort(
        loops, key=lambda loop: min(position[unit] for unit in loops.nodes[loop]["members"])
    )
    return [unit for loop in sequence for unit in sorted(loops.nodes[loop]["members"], key=position.__getitem__)]


def _parse(text: str, participants: Mapping[str, Participant]) -> Connection:
    match = _ARROW.match(text)
    if match is None:
        raise InputError(f"connections: '{text}' cannot be read; write it as 'unit.output -> unit.input'")
    source, target = End(match[1], match[2]), End(match[3], match[4])
    for end, side in ((source, "output"), (target, "input")):
        if end.unit not in participants:
            raise InputError(f"connections: '{text}': unknown unit '{end.unit}'{did_you_mean(end.unit, participants)}")
        ports = participants[end.unit].outputs if side == "output" else participants[end.unit].inputs
        if end.name not in ports:
            hint = did_you_mean(end.name, ports)
            raise InputError(f"connections: '{text}': unit '{end.unit}' has no {side} '{end.name}'{hint}")
    return Connection(source, target)


def _check(connection: Connection, source: Port, target: Port) -> None:
    if source.shape != target.shape:
        raise InputError(
            f"connections: '{connection}': the shapes differ, {source.shape} -> {target.shape}; "
            "both units have to be built for the same mesh"
        )
    if source.unit is not None and target.unit is not None and source.unit != target.unit:
        raise InputError(
            f"connections: '{connection}': the units of measure differ, {source.unit} -> {target.unit}; "
            "no conversion is made"
        )
