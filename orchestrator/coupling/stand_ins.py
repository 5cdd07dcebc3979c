"""Inputs that another unit has to provide: their start values are only placeholders."""

from collections.abc import Collection, Mapping, Sequence

from ..errors import InputError
from ..participants.participant import Participant
from .connections import Connection


def check_stand_ins(
    participants: Mapping[str, Participant], connections: Sequence[Connection], started: Mapping[str, Collection[str]]
) -> None:
    """InputError for an input with a stand-in that no output feeds; `started` are those with a start value, by unit.

    A fibre direction, for instance, starts as any unit vector, so that a unit runs by itself; with such fibres
    the results of a heart would be meaningless.
    """
    for name, participant in participants.items():
        fed = {link.target.name.partition("[")[0] for link in connections if link.target.unit == name}
        given = {start.partition("[")[0] for start in started.get(name, ())}
        for port in participant.inputs.values():
            if port.stand_in and port.name not in fed | given:
                raise InputError(
                    f"units.{name}: no output feeds its input '{port.name}', which another unit has to provide; "
                    f"add a unit with an output '{port.name}' (fiber_generator provides fibres), or a connection"
                )
