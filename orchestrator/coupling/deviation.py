"""What the inputs of a step were wrong by, as far as the values at its two ends tell.

Between its ends an output is taken to run along a line, and the line to be wrong by as much as the value at the end is
from the line through the two values before. An input that a unit ramps to the value known for the end follows that
line. One that is held errs by half the change over the step, whatever the line; so does, by the whole of it, one whose
value at the end is not known and taken to be the last. A unit without memory is not concerned by what an input is
inside a step.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..participants.participant import Participant, Values
from .connections import End
from .exchange import Exchange


@dataclass(frozen=True)
class Deviation:
    """What a connected output, or an input fed by it, was wrong by; of which order in the step."""

    end: End
    values: Values
    order: int


def deviations(exchange: Exchange, participants: Mapping[str, Participant]) -> Iterator[Deviation]:
    """The deviations of a step just taken, of outputs that took it and have a past."""
    for end in exchange.moving:
        if exchange.stepped(end) and exchange.depth(end) > 1:
            yield Deviation(end, exchange.latest(end) - exchange.foretold(end, 1), 2)
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
