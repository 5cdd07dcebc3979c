"""An experiment run again: the FMU as the master's participant, from communication point to communication point."""

from collections.abc import Iterable, Sequence

import numpy as np

from ..errors import InputError, ParticipantError, ParticipantTerminated
from ..participants.participant import Participant, Values
from .communication import Communication
from .stimuli import Stimulus
from .unverified import Unverified

#: How far the time an FMU ends at may be from the communication point that it is, relative to the step.
_SAME = 1e-6


def rerun(
    participant: Participant, given: Sequence[Stimulus], names: Iterable[str], communication: Communication
) -> dict[str, list[Values]]:
    """The values of the variables `names` at every row of the results.

    Inputs have the value of their stimulus at the begin of a step, and keep it over the step.

    Raises
    ------
    Unverified
        If the FMU fails, or ends the simulation elsewhere than the results end.
    """
    run = _Run(participant, given, names, communication)
    run.start()
    for point in range(len(communication.sizes)):
        if not run.step(point):
            break
    return run.values


class _Run:
    def __init__(
        self, participant: Participant, given: Sequence[Stimulus], names: Iterable[str], communication: Communication
    ) -> None:
        self._participant, self._given, self._communication = participant, given, communication
        self.values: dict[str, list[Values]] = {name: [] for name in names}
        self._last = max(communication.rows)

    def start(self) -> None:
        """Initialise the FMU with the inputs at the start, and read the first row."""
        begin = float(self._communication.points[0])
        try:
            self._participant.begin()
            self._give(0, self._given)
            self._participant.complete()
            self._read(0)
        except (ParticipantError, InputError) as error:
            raise Unverified(f"the FMU failed during initialization at {begin:g} s: {error}") from None

    def step(self, point: int) -> bool:
        """Take the step from the communication point of this number, and read what it leads to; whether to go on."""
        begin, size = float(self._communication.points[point]), float(self._communication.sizes[point])
        try:
            self._give(point, [stimulus for stimulus in self._given if not stimulus.is_constant])
            self._participant.start(begin, size)()
        except ParticipantTerminated as error:
            self._end(point, begin + size if error.time_s is None else error.time_s, size)
            return False
        except ParticipantError as error:
            raise Unverified(f"the FMU failed in the step from {begin:g} to {begin + size:g} s: {error}") from None
        if point + 1 > self._last and not self._communication.is_whole:
            raise Unverified(f"the results end at {begin:g} s, but the experiment continues")
        self._read(point + 1)
        return True

    def _end(self, point: int, time: float, size: float) -> None:
        """The FMU asks for the end of the simulation at `time`, in or after the step from `point`."""
        points = self._communication.points
        near = np.flatnonzero(np.abs(points[point : point + 2] - time) <= _SAME * size)
        reached = point + int(near[0]) if near.size else point
        if reached > point:
            self._read(reached)
        if reached != self._last:
            raise Unverified(
                f"the FMU ended the simulation at {time:g} s, and the results end at {points[self._last]:g} s"
            )

    def _give(self, point: int, given: Iterable[Stimulus]) -> None:
        time = float(self._communication.points[point])
        size = float(self._communication.sizes[point])
        for stimulus in given:
            self._participant.set(stimulus.name, stimulus.at(time, size))

    def _read(self, point: int) -> None:
        if point not in self._communication.rows:
            return
        try:
            for name, values in self.values.items():
                values.append(self._participant.get(name))
        except ParticipantError as error:
            time = self._communication.points[point]
            raise Unverified(f"the FMU failed when its variables were read at {time:g} s: {error}") from None
