"""The fields between the participants: their latest values, and their way from output to input.

A unit that steps needs its inputs over the step. An output that has been computed for the step's end is known there;
of another only the past is known, and it is extrapolated by a polynomial through the last exchanges (order 0: its last
value). A unit that ramps its inputs gets their values at the begin and the end of its step; any other sees the value
at the end, held. A discrete output, a whole number or a text for instance, changes at events only: it is neither
extrapolated nor ramped, and keeps its value of the last exchange until the next one is known. FMI 2.0 leaves open
which time an input belongs to that is set before a step (its section 4.2.4 lets a master set any value); here it is
always the step's end.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np

from ..errors import ParticipantError
from ..participants.participant import Participant, Port, Ramp, Values
from .connections import Connection, End, fitted
from .history import History

_MS_PER_S = 1000.0


@dataclass(frozen=True)
class Use:
    """What an input was in the last step, in its source's terms: the value at the step's end, ramped to or held."""

    end: Values
    ramped: bool


@dataclass(frozen=True)
class Inputs:
    """How inputs behave between exchanges: order of their extrapolation, and whether units that can ramp them do."""

    extrapolation: int = 0
    linear: bool = False
    #: Past values kept beyond what the extrapolation needs, for those who estimate errors.
    depth: int = 1


class Exchange:
    """The latest values of all connected outputs. A step: `begin`, `feed` and `collect`, then `accept` or `undo`."""

    def __init__(
        self, participants: Mapping[str, Participant], connections: Iterable[Connection], inputs: Inputs | None = None
    ) -> None:
        self._participants = participants
        self._connections = tuple(connections)
        # By unit: what feeds it, and its connected outputs in order, each once.
        self._feeding: defaultdict[str, list[Connection]] = defaultdict(list)
        self._sources: defaultdict[str, dict[End, Port]] = defaultdict(dict)
        for link in self._connections:
            self._feeding[link.target.unit].append(link)
            self._sources[link.source.unit][link.source] = participants[link.source.unit].outputs[link.source.name]
        self._behaviour = inputs or Inputs()
        self._depth = max(self._behaviour.extrapolation + 1, self._behaviour.depth)
        self._values: dict[End, Values] = {}
        self._before: dict[End, Values] = {}
        self._histories: dict[End, History] = {}
        # In order, each once.
        self._discrete: dict[End, None] = {}
        # The connected inputs of each unit as they were when it was stepped last: where their ramps begin.
        self._begins: dict[str, dict[End, Values]] = {}
        self._known: set[End] = set()
        self._collected: set[End] = set()
        self._uses: dict[Connection, Use] = {}
        self._end = 0.0

    @property
    def moving(self) -> list[End]:
        """The connected outputs that change continuously with time."""
        return list(self._histories)

    @property
    def end_ms(self) -> float:
        """Where the present step ends."""
        return self._end * _MS_PER_S

    @property
    def extrapolation(self) -> int:
        """Order by which inputs that are not known yet are extrapolated."""
        return self._behaviour.extrapolation

    @property
    def discrete(self) -> list[End]:
        """The connected outputs that change at events: of them only their equality has a meaning."""
        return list(self._discrete)

    # --- a step -------------------------------------------------------------------------------------------------------

    def begin(self, end: float) -> None:
        """A step to the time `end` (s) begins."""
        self._end = end
        self._before = dict(self._values)
        self._known.clear()
        self._collected.clear()
        self._uses.clear()

    def accept(self, units: Iterable[str]) -> None:
        """The step is over: the values are those at its end; `units` stepped."""
        for end in self._collected:
            self._remember(end)
        for unit in units:
            self.mark(unit)

    def mark(self, unit: str) -> None:
        """The inputs of `unit` are what they are now: where its next ramps begin."""
        self._begins[unit] = {
            link.source: self._values[link.source] for link in self._feeding[unit] if link.source in self._histories
        }

    def undo(self) -> None:
        """The step is not taken: everything is as before `begin`."""
        self._values = dict(self._before)
        self._known.clear()
        self._collected.clear()

    # --- values -------------------------------------------------------------------------------------------------------

    def collect(self, unit: str, initially: bool = False) -> None:
        """Fetch the connected outputs of `unit`; the fixed ones only `initially`."""
        for end, port in self._sources[unit].items():
            if initially or not port.fixed:
                self._values[end] = self._fetch(end)
                self._known.add(end)
                self._collected.add(end)
                if port.fixed or not initially:
                    continue
                if port.discrete:
                    self._discrete[end] = None
                else:
                    self._histories[end] = History(self._depth)
                    self._remember(end)

    def feed(self, unit: str, initially: bool = False) -> None:
        """Set the connected inputs of `unit` for its step; the fixed ones only `initially`."""
        participant = self._participants[unit]
        ramps = self._behaviour.linear and participant.abilities.ramps and not initially
        for link in self._feeding[unit]:
            if link.source not in self._values:
                continue
            port = participant.inputs[link.target.name]
            if (port.fixed or self._is_fixed(link.source)) and not initially:
                continue
            at_end = self._at_end(link.source)
            self._uses[link] = Use(at_end, ramps)
            with blaming(unit):
                # What changes at events only jumps to where it is: it is held.
                if ramps and not port.discrete and link.source in self._histories:
                    participant.ramp(port.name, self._ramp(unit, link, port))
                else:
                    participant.set(port.name, fitted(link.carried(at_end), port))
        if initially:
            self.mark(unit)

    def latest(self, end: End) -> Values:
        """The value that connected inputs are fed with."""
        return self._values[end]

    def overwrite(self, values: Mapping[End, Values]) -> None:
        """Feed connected inputs with `values`, as those at the step's end, until the outputs are collected again."""
        self._values.update(values)
        self._known.update(values)

    def extrapolated(self, end: End, order: int | None = None) -> Values:
        """An output extrapolated from its past values to the end of the step, by default in the order of inputs."""
        if end not in self._histories:
            return self._values[end]
        return self._histories[end].extrapolated(self._end, self._behaviour.extrapolation if order is None else order)

    def begun(self, link: Connection) -> Values:
        """What the input of `link` is fed by as it was when its unit was stepped last, where a ramp begins."""
        return self._begins[link.target.unit].get(link.source, self._values[link.source])

    def used(self) -> Iterator[tuple[Connection, Use]]:
        """How inputs were set in this step whose source and whose unit both took it."""
        return ((link, use) for link, use in self._uses.items() if link.source in self._collected)

    def stepped(self, end: End) -> bool:
        """Whether the value of an output is new in this step; that of a unit which waits is older."""
        return end in self._collected

    def depth(self, end: End) -> int:
        """How many past values of an output are known; of a discrete one the last."""
        return len(self._histories[end].samples()) if end in self._histories else 1

    def value(self, unit: str, name: str) -> Values:
        """The value of an output at the latest exchange, fetched if it is not connected."""
        end = End(unit, name)
        return self._values[end] if end in self._values else self._fetch(end)

    # --- checkpoints --------------------------------------------------------------------------------------------------

    def memory(self) -> dict[str, Any]:
        """All that `resume` needs, between two steps."""
        return {
            "values": {str(end): value for end, value in self._values.items() if end in self._histories},
            "discrete": {str(end): _storable(self._values[end]) for end in self._discrete},
            "times": {
                str(end): np.array([time for time, _ in history.samples()]) for end, history in self._histories.items()
            },
            "samples": {
                str(end): np.stack([values for _, values in history.samples()])
                for end, history in self._histories.items()
            },
            "begins": {
                unit: {str(end): value for end, value in begins.items()} for unit, begins in self._begins.items()
            },
        }

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave, after the initialisation."""
        for end, history in self._histories.items():
            self._values[end] = memory["values"][str(end)]
            history.resume(list(zip(memory["times"][str(end)].tolist(), memory["samples"][str(end)], strict=True)))
        for end in self._discrete:
            self._values[end] = _restored(memory["discrete"][str(end)], self._values[end])
        sources = {str(link.source): link.source for link in self._connections}
        for unit, begins in memory["begins"].items():
            self._begins[unit] = {sources[name]: value for name, value in begins.items()}

    # --- inside -------------------------------------------------------------------------------------------------------

    def _at_end(self, source: End) -> Values:
        if source in self._known or source not in self._histories:
            return self._values[source]
        return self.extrapolated(source)

    def _ramp(self, unit: str, link: Connection, port: Port) -> Ramp:
        """How the input `port` runs over the step, fed by `link`."""
        source, curvature = link.source, None
        end = self._at_end(source)
        begin = self._begins[unit].get(source, self._values[source])
        if self._behaviour.extrapolation >= 2:
            curvature = 0.0 * end if source in self._known else self._histories[source].curvature()
        ramp = link.ramped(Ramp(begin, end, curvature))
        curvature = None if ramp.curvature is None else fitted(ramp.curvature, port)
        return Ramp(fitted(ramp.begin, port), fitted(ramp.end, port), curvature)

    def _remember(self, end: End) -> None:
        if end in self._histories:
            self._histories[end].add(self._end, self._values[end])

    def _is_fixed(self, end: End) -> bool:
        return self._sources[end.unit][end].fixed

    def _fetch(self, end: End) -> Values:
        with blaming(end.unit):
            values = self._participants[end.unit].get(end.name)
            _check_finite(end, values)
        return values


class Blaming:
    """See `blaming`. Entered a dozen times in every step, where a generator would take longer."""

    __slots__ = ("_unit",)

    def __init__(self, unit: str) -> None:
        self._unit = unit

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, ParticipantError):
            error.unit = error.unit or self._unit


def blaming(unit: str) -> Blaming:
    """A ParticipantError from inside is that of `unit`."""
    return Blaming(unit)


def _check_finite(end: End, values: Values) -> None:
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        index = np.argwhere(~np.isfinite(np.atleast_1d(values)))[0].tolist()
        raise ParticipantError(f"its output {end.name} is not finite, first at index {index}")


def _storable(values: Values) -> Values:
    """`values` as numbers, whatever they are: a file of arrays has no texts of any length."""
    if values.dtype.kind != "U":
        return values
    return np.frombuffer(json.dumps(values.tolist()).encode(), np.uint8)


def _restored(stored: Values, like: Values) -> Values:
    """What `_storable` made of values of the type and shape of `like`."""
    if like.dtype.kind != "U":
        return stored.astype(like.dtype)
    return np.array(json.loads(stored.tobytes()), dtype=np.str_).reshape(like.shape)
