"""What a scenario does not model: the effects that its units could have, but nothing gives them."""

from collections.abc import Iterator, Mapping, Sequence, Set

from .coupling.connections import Connection
from .participants.driven import Driven
from .participants.participant import Participant, Port


def omissions(participants: Mapping[str, Participant], connections: Sequence[Connection]) -> list[str]:
    """A sentence for each input that nothing feeds, with the reason."""
    return list(_unconnected(participants, connections))


def _unconnected(participants: Mapping[str, Participant], connections: Sequence[Connection]) -> Iterator[str]:
    fed = {(link.target.unit, link.target.name) for link in connections}
    fed |= {(name, signal) for name, signals in driven_inputs(participants).items() for signal in signals}
    for name, participant in participants.items():
        for port in participant.inputs.values():
            if not port.live:
                yield f"{name}.{port.name}: {port.needs} of the unit is 0, so it has no influence and is not connected"
            elif (name, port.name) not in fed and not _fed_in_part(name, port, fed):
                yield f"{name}.{port.name}: {_unfed(port, participants)}, so it keeps its start value"


def _unfed(port: Port, participants: Mapping[str, Participant]) -> str:
    """Why no output of its name feeds an input."""
    for name, participant in participants.items():
        output = participant.outputs.get(port.name)
        if output is not None and not output.live:
            return f"{output.needs} of {name}, which gives it, is 0"
    return "no unit gives it"


def _fed_in_part(unit: str, port: Port, fed: Set[tuple[str, str]]) -> bool:
    """Whether single elements of an array are fed."""
    return any(name == unit and element.startswith(f"{port.name}[") for name, element in fed)


def driven_inputs(participants: Mapping[str, Participant]) -> dict[str, list[str]]:
    """The inputs of each unit that follow signals of a file."""
    return {name: list(unit.signals) for name, unit in participants.items() if isinstance(unit, Driven)}
