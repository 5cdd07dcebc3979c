"""The columns of a time series: the variables that were asked for, or else those that are worth a column."""

from collections.abc import Mapping

from ..errors import InputError
from .participant import Participant, Port

#: Elements of an array that all get columns of their own, where nobody asks for them.
_SMALL = 100

#: Columns of a table that a person can still use.
_MOST = 10_000


def recorded(participants: Mapping[str, Participant]) -> list[tuple[str, Port]]:
    """What the time series has of each unit; InputError if that is more than a table should hold."""
    chosen = [(unit, port) for unit, participant in participants.items() for port in participant.observed.values()]
    if not chosen:
        chosen = [
            (unit, port)
            for unit, participant in participants.items()
            for port in participant.outputs.values()
            if port.record == "probes" or (port.record != "nothing" and port.size <= _SMALL)
        ]
        # Probed fields first, then scalars, then those that are drawn from a field.
        chosen.sort(key=lambda item: (item[1].record != "probes", item[1].of is not None))
    count = sum(port.size for _, port in chosen if port.record != "probes")
    if count > _MOST:
        raise InputError(f"output.variables: {count} columns are too many for a table (at most {_MOST}); choose fewer")
    return chosen
