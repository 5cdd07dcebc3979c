"""The error of the inputs of a step, estimated from the values at its two ends.

Within a step an output is assumed to vary linearly, and the error of that to be the distance of the value at the end
from the line through the two values before. An input with first-order hold, to a value that is known for the end, has
only this error. With zero-order hold a second error is half the change over the step. Where the value at the end is not
known and taken to be the last one, the second error is the whole change. The course of an input within a step does not
matter to a unit without memory.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..participants.participant import Participant, Values
from .connections import End
from .exchange import Exchange


@dataclass(frozen=True)
class Deviation:
    """The error of a connected output, or of an input fed by it, and its order of accuracy in the step."""

    end: End
    values: Values
    order: int


def deviations(exchange: Exchange, participants: Mapping[str, Participant]) -> Iterator[Deviation]:
    """The deviations of a step just taken, of outputs that took it and have a past."""
    for end in exchange.moving:
        if exchange.stepped(end) and exchange.depth(end) > 1:
            yield Deviation(end, exchange.latest(end) - exchange.extrapolated(end, 1), 2)
    for link, use in exchange.used():
        end = link.source
        if exchange.depth(end) < 2:
            continue
        found = exchange.latest(end)
        if use.ramped or participants[link.target.unit].abilities.memoryless:
            # An extrapolation of higher order errs by what the line does, which is counted already.
            if exchange.extrapolation == 0:
                yield Deviation(end, use.end - found, 1)
        else:
            yield Deviation(end, use.end - 0.5 * (exchange.begun(link) + found), 1)
