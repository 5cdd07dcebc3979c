"""The master algorithm: initialisation and the coupled time loop over any participants.

Whatever ends the loop, those who watch it (`Observer`) have seen every accepted step before.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from ..errors import (
    InputError,
    NotConverged,
    ParticipantError,
    ParticipantLost,
    ParticipantTerminated,
    RunError,
    Terminated,
    did_you_mean,
)
from ..participants.participant import Participant, Wait
from ..stopwatch import Moment, Span, Stopwatch, Usage, seconds_by_label
from .connections import Connection
from .diagnosis import Diagnosis
from .exchange import Exchange, Inputs, blaming
from .growth import Growth
from .loops import groups_in_order
from .missed_tolerance import Missed
from .rollback import Rollback
from .schemes import Scheme, Sweeps
from .step_control import FixedStep, StepControl, Verdict
from .timeline import Timeline

_MS_PER_S = 1000.0

#: Label of the time that no unit used: exchange, recording, bookkeeping.
MASTER = "master"

#: Label of the time in which the master waits for units.
WAITING = "waiting"


@dataclass(frozen=True)
class Accepted:
    """What is known of a step that was accepted (step 0 is the initial state).

    `error` is its estimated error over the tolerance, if there is one; `missed` says that it is above and the step
    could not be any shorter.
    """

    number: int
    time_ms: float
    size_ms: float
    sweeps: Sweeps = field(default_factory=Sweeps)
    rejected: int = 0
    error: float | None = None
    missed: bool = False
    seconds: Mapping[str, float] = field(default_factory=dict)
    spans: tuple[Span, ...] = ()
    is_output: bool = True
    #: Units that did not step in this exchange: their outputs are those of an earlier time.
    waiting: frozenset[str] = frozenset()
    #: By exchanged field, the factor by which its alternation from step to step grows (`growth`).
    growth: Mapping[str, float | None] = field(default_factory=dict)


class Observer(Protocol):
    """Sees the state after the initialisation and after every accepted step."""

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """The outputs in `exchange` are those at `step.time_ms`."""


class Master:
    """Couples `participants` by `connections` with `scheme`.

    Parameters
    ----------
    timeline:
        The times at which steps may end.
    order:
        The stepping units in the order of the scheme; None takes the participants' order.
    inputs:
        How inputs behave between exchanges; held if not given.
    control:
        Chooses the steps; every tick of the timeline if not given. One that refuses steps needs units that roll back.
    every:
        Units that are stepped only at every so-many-th exchange, and at output times; the others at each.

    Attributes
    ----------
    growth:
        Which exchanged fields alternate from step to step, and how fast that grows.
    diagnosis:
        What is to be told of them.
    solves:
        How many steps each unit was asked to take, those of sweeps that were repeated and of steps that were refused
        or failed included.
    sweeps:
        How many sweeps over the units there were: one for each explicit step; for an iterated one, as many as the loop
        needed that needed most of them. Those of steps that were refused or failed are counted too.
    """

    def __init__(
        self,
        participants: Mapping[str, Participant],
        connections: Sequence[Connection],
        scheme: Scheme,
        timeline: Timeline,
        order: Sequence[str] | None = None,
        inputs: Inputs | None = None,
        control: StepControl | None = None,
        every: Mapping[str, int] | None = None,
    ) -> None:
        self.participants = participants
        self.connections = connections
        self.units = stepping_order(participants, order)
        self.exchange = Exchange(participants, connections, inputs)
        solved = scheme.solved(self.units)
        self.growth = Growth(participants, connections, solved)
        self.diagnosis = Diagnosis(participants, connections, self.units, scheme, self.exchange.extrapolation)
        self.watch = Stopwatch()
        self.solves: Counter[str] = Counter()
        self.sweeps = 0
        self._scheme = scheme
        self._timeline = timeline
        self._control = control or FixedStep()
        self._every = every or {}
        self._initialised = False
        self._settled = Sweeps()
        self._tick = 0
        self._number = 0
        # Where each unit's own time stands, and how many exchanges it has let pass.
        self._reached = dict.fromkeys(self.units, 0)
        self._passed = dict.fromkeys(self.units, 0)

    @property
    def done(self) -> bool:
        """Whether the run is at its end."""
        return self._tick >= self._timeline.stop

    @property
    def missed(self) -> Missed:
        """The steps that missed the tolerance of adaptive steps, by what is known now."""
        return self._control.missed()

    def initialise(self) -> None:
        """Bring all units to their initial state, each after those that feed it.

        Raises
        ------
        InputError
            For what the person gave and only a unit can judge, a boundary that the mesh lacks for one.
        RunError
            Where a unit has no initial state.
        """
        static = [unit for unit in self.participants if unit not in self.units]
        for group in groups_in_order([*static, *self.units], self.connections):
            if group.is_loop and self._scheme.settles:
                self._settle(group.units)
            else:
                for unit in group.units:
                    with self._initialising(unit):
                        self._begin(unit)
                        self.exchange.feed(unit, initially=True)
                        self._complete(unit)
        self.growth.begin(self.exchange)
        self._initialised = True

    def run(self, observers: Sequence[Observer], stop: Any = False) -> None:
        """Initialise, if that is not done yet, and step to the end, or until `stop` is true between two steps.

        RunError names the unit, the time and why.
        """
        if not self._initialised:
            self.initialise()
        if self._number == 0:
            with _failing("failed during initialisation"):
                self._show(Accepted(0, 0.0, 0.0, self._settled, spans=self.watch.lap()), observers)
        while not self.done and not stop:
            accepted = self._take_step()
            with _failing(*_told(accepted.time_ms - accepted.size_ms, accepted.time_ms), accepted.time_ms):
                self._show(accepted, observers)

    # --- checkpoints --------------------------------------------------------------------------------------------------

    def memory(self) -> dict[str, Any]:
        """All that `resume` needs to go on from here, to the bit; the states of the units as bytes.

        ParticipantError where a unit cannot give its state away.
        """
        states = {}
        for unit in self.units:
            with blaming(unit):
                states[unit] = np.frombuffer(self.participants[unit].pack(), np.uint8)
        return {
            "tick": self._tick,
            "number": self._number,
            "reached": dict(self._reached),
            "passed": dict(self._passed),
            "solves": {unit: self.solves[unit] for unit in self.units},
            "sweeps": self.sweeps,
            "states": states,
            "exchange": self.exchange.memory(),
            "scheme": self._scheme.memory(),
            "control": self._control.memory(),
            "growth": self.growth.memory(),
        }

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Initialise, and go on from what `memory` gave, perhaps in another process."""
        self.initialise()
        for unit in self.units:
            with blaming(unit), _failing("cannot continue from the checkpoint"):
                self.participants[unit].unpack(memory["states"][unit].tobytes())
            self._reached[unit] = int(memory["reached"][unit])
            self._passed[unit] = int(memory["passed"][unit])
            self.solves[unit] = int(memory["solves"][unit])
        self.sweeps = int(memory["sweeps"])
        self._tick, self._number = int(memory["tick"]), int(memory["number"])
        self.exchange.resume(memory["exchange"])
        self._scheme.resume(memory.get("scheme", {}))
        self._control.resume(memory.get("control", {}))
        self.growth.resume(memory["growth"])

    # --- inside -------------------------------------------------------------------------------------------------------

    def _suspicions(self) -> list[str]:
        """What alternated before a step failed."""
        return self.diagnosis.paragraphs(self.growth.suspected)

    @contextmanager
    def _initialising(self, label: str) -> Iterator[None]:
        measured = self.watch.measure(WAITING, "initialise"), self.watch.measure(label, "initialise")
        with measured[0], measured[1], _failing("failed during initialisation"):
            yield

    def _begin(self, unit: str) -> None:
        with blaming(unit):
            self._charged(unit, self.participants[unit].begin)

    def _complete(self, unit: str) -> None:
        with blaming(unit):
            self._charged(unit, self.participants[unit].complete)
        self.exchange.collect(unit, initially=True)

    def _charged(self, unit: str, call: Callable[[], Usage | None]) -> None:
        """Do a `call` of `unit`, and charge it with the CPU time of that."""
        begun = Moment.now()
        usage = call()
        self.watch.charge(unit, usage or begun.used())

    def _settle(self, loop: Sequence[str]) -> None:
        """Initialise the units of a loop together, with initial values that agree."""
        for unit in loop:
            with self._initialising(unit):
                self._begin(unit)

        def complete() -> None:
            for unit in loop:
                with self._initialising(unit):
                    self._complete(unit)

        with _failing("failed during initialisation"):
            settled = self._scheme.settle(loop, self.exchange, complete)
        self._settled = Sweeps((*self._settled.loops, *settled.loops), self._settled.converged and settled.converged)
        for unit in loop:
            self.exchange.mark(unit)

    def _take_step(self) -> Accepted:
        """Step until a step is good enough; shorter from one attempt to the next."""
        rejected, causes = 0, dict[str, str]()
        with self.watch.measure(MASTER, "step"):
            while True:
                ticks = self._control.next(self._tick)
                begin, end = self._timeline.time_ms(self._tick), self._timeline.time_ms(self._tick + ticks)
                units = self._due(ticks)
                with _failing(*_told(begin, end, causes, self._suspicions), end):
                    attempt = self._attempt(units, ticks, end, causes)
                if attempt is not None:
                    break
                rejected += 1
            sweeps, verdict = attempt
            self._tick += ticks
            self._number += 1
            self.exchange.accept(units)
            growth = self.growth.add(self.exchange)
            for unit in self.units:
                self._passed[unit] += 1
            for unit in units:
                self._reached[unit], self._passed[unit] = self._tick, 0
        spans = self.watch.lap()
        seconds = dict.fromkeys(self.units, 0.0) | seconds_by_label(spans)
        seconds[MASTER] -= seconds.pop(WAITING, 0.0)
        return Accepted(
            self._number,
            end,
            self._timeline.size_ms(ticks),
            sweeps,
            rejected,
            verdict.error,
            verdict.missed,
            seconds,
            spans,
            self._timeline.is_output(self._tick),
            frozenset(self.units) - frozenset(units),
            growth,
        )

    def _attempt(
        self, units: Sequence[str], ticks: int, end_ms: float, causes: dict[str, str]
    ) -> tuple[Sweeps, Verdict] | None:
        """One step to `end_ms`; None if it was refused, and everything is as before.

        Why a unit or the coupling failed in a step that can be repeated shorter is added to `causes`, once.
        """
        self.exchange.begin(end_ms / _MS_PER_S)
        asked = Counter[str]()
        with Rollback(self.participants, units if self._control.refuses else ()) as before:
            try:
                sweeps = self._scheme.advance(units, self.exchange, partial(self._step, self._tick + ticks, asked))
                verdict = self._control.judge(self.exchange, ticks)
                if verdict.accepted:
                    return sweeps, verdict
            except (ParticipantError, NotConverged) as error:
                # Neither a unit that is gone nor one that has come to its end is helped by a shorter step.
                final = isinstance(error, ParticipantLost | ParticipantTerminated)
                if final or not self._control.shorten(ticks):
                    raise
                causes.setdefault(str(error), _cause(error, self._timeline.size_ms(ticks)))
            finally:
                self.solves.update(asked)
                # A sweep steps each of its units once.
                self.sweeps += max(asked.values(), default=1)
            before.restore()
            self.exchange.undo()
        return None

    def _due(self, ticks: int) -> list[str]:
        """The units that step in an exchange of so many ticks: at output times all of them."""
        end = self._tick + ticks
        if self._timeline.is_output(end) or end >= self._timeline.stop:
            return list(self.units)
        return [unit for unit in self.units if self._passed[unit] + 1 >= self._every.get(unit, 1)]

    def _step(self, end: int, asked: Counter[str], units: Sequence[str]) -> None:
        """Step `units` at the same time, each from where it is to the tick `end`, and count them as `asked`."""
        started: list[tuple[str, float, Usage, Wait]] = []
        failure: ParticipantError | None = None
        with self.watch.measure(WAITING, "units"):
            for unit in units:
                begun, reached = Moment.now(), self._reached[unit]
                asked[unit] += 1
                time, size = self._timeline.time_ms(reached), self._timeline.size_ms(end - reached)
                try:
                    with blaming(unit):
                        wait = self.participants[unit].start(time / _MS_PER_S, size / _MS_PER_S)
                except ParticipantError as error:
                    failure = failure or error
                    here = begun.used()
                    self.watch.add(unit, "failed step", begun.wall_s, here.wall_s)
                    self.watch.charge(unit, here)
                else:
                    started.append((unit, begun.wall_s, begun.used(), wait))
            # All are waited for, even if one has failed: none may be busy when it is spoken to again.
            for unit, begin, here, wait in started:
                try:
                    with blaming(unit):
                        usage = wait() or here
                    self.watch.add(unit, "step", begin, usage.wall_s)
                    self.watch.charge(unit, usage)
                except ParticipantError as error:
                    failure = failure or error
                    self.watch.add(unit, "failed step", begin, perf_counter() - begin)
                    self.watch.charge(unit, error.usage or here)
        if failure is not None:
            raise failure

    def _show(self, step: Accepted, observers: Sequence[Observer]) -> None:
        for observer in observers:
            observer.accept(step, self.exchange)


def _told(
    begin_ms: float,
    end_ms: float,
    causes: Mapping[str, str] | None = None,
    suspicions: Callable[[], Sequence[str]] = tuple,
) -> tuple[str, Callable[[], str]]:
    """When a step failed, and what is left; with why longer steps were given up before, as `causes` know by then.

    `suspicions` are paragraphs on what may have led to it.
    """

    def left() -> str:
        earlier = "".join(f"; before that {cause}" for cause in (causes or {}).values())
        return ". ".join([f"{earlier}. The results up to {begin_ms:g} ms are complete", *suspicions()])

    return f"failed in the step from {begin_ms:g} to {end_ms:g} ms", left


def _cause(error: ParticipantError | NotConverged, size_ms: float) -> str:
    who = "the coupling" if isinstance(error, NotConverged) else f"unit '{error.unit}'"
    return f"{who} failed in a step of {size_ms:g} ms: {error}"


@contextmanager
def _failing(when: str, left: Callable[[], str] = str, time_ms: float | None = None) -> Iterator[None]:
    """Make a RunError, of the step to `time_ms`, of what a participant, or the coupling of them, could not do."""
    try:
        yield
    except ParticipantTerminated as error:
        ended = Terminated(f"unit '{error.unit}' ended the simulation: {error}{left()}")
        raise _about(ended, "terminated", time_ms, error.unit) from error
    except ParticipantError as error:
        failed = RunError(f"unit '{error.unit}' {when}: {error}{left()}")
        raise _about(failed, "unit", time_ms, error.unit) from error
    except NotConverged as error:
        missed = _about(RunError(f"the coupling {when}: {error}{left()}"), "coupling", time_ms)
        missed.sweeps = error.sweeps
        raise missed from error


def _about(error: RunError, kind: str, time_ms: float | None, unit: str | None = None) -> RunError:
    error.kind, error.time_ms, error.unit = kind, time_ms, unit
    return error


def stepping_order(participants: Mapping[str, Participant], order: Sequence[str] | None) -> list[str]:
    """The units that step: all but those whose outputs are fixed. InputError if `order` is no order of them."""
    moving = [
        name
        for name, participant in participants.items()
        if not participant.outputs or not all(port.fixed for port in participant.outputs.values())
    ]
    if order is None:
        return moving
    for name in order:
        if name not in participants:
            raise InputError(f"coupling.order: unknown unit '{name}'{did_you_mean(name, participants)}")
    if len(set(order)) != len(order):
        raise InputError("coupling.order: a unit is named twice")
    missing = [name for name in moving if name not in order]
    if missing:
        raise InputError(f"coupling.order: {', '.join(missing)} is missing; name every unit that steps")
    return [name for name in order if name in moving]
