"""A participant some of whose inputs follow signals of a file (`signals`), set before each of its steps.

An input that is held gets the signal's value at the step's end, as connected inputs do; one that is ramped runs from
the value at the begin to that right before the end, where a jump may be.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, did_you_mean
from ..stopwatch import Usage
from .participant import Abilities, Implementation, Participant, Ports, Ramp, Values, Wait
from .signals import Signal, read_table


class Driven:
    """`participant` with inputs that follow `signals`, by their names; `ramps`: continuous ones are to be ramped."""

    def __init__(self, participant: Participant, signals: Mapping[str, Signal], ramps: bool) -> None:
        self._participant = participant
        self.signals = dict(signals)
        self._ramps = ramps
        self.name = participant.name
        self.inputs: Ports = participant.inputs
        self.outputs: Ports = participant.outputs
        self.observed: Ports = participant.observed
        self.abilities: Abilities = participant.abilities

    def begin(self) -> Usage | None:
        """See Participant."""
        usage = self._participant.begin()
        for name, signal in self.signals.items():
            self._participant.set(name, signal.at(0.0, 0.0))
        return usage

    def complete(self) -> Usage | None:
        """See Participant."""
        return self._participant.complete()

    def set(self, name: str, values: Values) -> None:
        """See Participant."""
        self._participant.set(name, values)

    def ramp(self, name: str, ramp: Ramp) -> None:
        """See Participant."""
        self._participant.ramp(name, ramp)

    def get(self, name: str) -> Values:
        """See Participant."""
        return self._participant.get(name)

    def start(self, time: float, size: float) -> Wait:
        """See Participant."""
        ramps = self._ramps and self.abilities.ramps
        for name, signal in self.signals.items():
            if self.inputs[name].fixed:
                continue
            if ramps and signal.is_continuous:
                ramp = Ramp(signal.at(time, size), signal.at(time + size, size, before=True))
                self._participant.ramp(name, ramp)
            else:
                self._participant.set(name, signal.at(time + size, size))
        return self._participant.start(time, size)

    def save(self) -> Any:
        """See Participant."""
        return self._participant.save()

    def restore(self, state: Any) -> None:
        """See Participant."""
        self._participant.restore(state)

    def free(self, state: Any) -> None:
        """See Participant."""
        self._participant.free(state)

    def pack(self) -> bytes:
        """See Participant."""
        return self._participant.pack()

    def unpack(self, data: bytes) -> None:
        """See Participant."""
        self._participant.unpack(data)

    def implementation(self) -> Implementation:
        """See Participant."""
        return self._participant.implementation()

    def log_to(self, path: Path) -> None:
        """See Participant."""
        self._participant.log_to(path)

    def close(self) -> None:
        """See Participant."""
        self._participant.close()


def drive(
    participants: Mapping[str, Participant], connected: Iterable[tuple[str, str]], path: Path, ramps: bool
) -> dict[str, Participant]:
    """`participants`; those whose inputs have signals in the file at `path` are replaced by Driven ones.

    `connected` are the inputs, by unit and name, that are fed otherwise. InputError for columns that drive nothing, or
    what is driven or connected already, and for what is no value of the input.
    """
    try:
        table = read_table(path)
        fed = set(connected)
        signals: dict[str, dict[str, Signal]] = {}
        for column in table.columns:
            unit, name = _target(column, participants, fed)
            port = participants[unit].inputs[name]
            if port.size != 1:
                first, *_, last = port.elements
                raise InputError(f"column '{column}': {unit}.{name} is an array; give columns for {first} to {last}")
            signal = Signal(table, column, port)
            if port.fixed and not signal.is_constant:
                raise InputError(f"column '{column}': {unit}.{name} is set once, before the run, and cannot change")
            fed.add((unit, name))
            signals.setdefault(unit, {})[name] = signal
    except InputError as error:
        raise InputError(f"inputs.file: {path}: {error}") from None
    return {
        name: Driven(participant, signals[name], ramps) if name in signals else participant
        for name, participant in participants.items()
    }


def _target(column: str, participants: Mapping[str, Participant], fed: set[tuple[str, str]]) -> tuple[str, str]:
    """The unit and the input that `column` drives, named with its unit or, where one alone has it, without."""
    unit, _, name = column.partition(".")
    if unit in participants and participants[unit].inputs.known(name):
        found = [(unit, name)]
    else:
        found = [(unit, column) for unit, participant in participants.items() if participant.inputs.known(column)]
    free = [(unit, name) for unit, name in found if not _is_fed(unit, name, participants[unit].inputs, fed)]
    if len(free) == 1:
        return free[0]
    if free:
        choice = " or ".join(f"{unit}.{name}" for unit, name in free)
        raise InputError(f"column '{column}': several units have this input; name it {choice}")
    if found:
        unit, name = found[0]
        raise InputError(
            f"column '{column}': the input {unit}.{name} is connected, or driven by another column; remove one of the "
            "two (`connect_by_name: false` connects nothing but what is written)"
        )
    known = {f"{unit}.{name}" for unit, participant in participants.items() for name in participant.inputs}
    if not unit or unit not in participants:
        known |= {name for participant in participants.values() for name in participant.inputs}
    raise InputError(f"column '{column}' is not an input of any unit{did_you_mean(column, known)}")


def _is_fed(unit: str, name: str, inputs: Ports, fed: set[tuple[str, str]]) -> bool:
    """Whether the input, the array it is an element of, or an element of it is among those that are `fed`."""

    def array(name: str) -> str | None:
        place = None if name in inputs else inputs.place(name)
        return None if place is None else place[0].name

    return (
        (unit, name) in fed
        or (unit, array(name)) in fed
        or any(other == unit and array(element) == name for other, element in fed)
    )
