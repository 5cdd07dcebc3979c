"""The inputs of a participant that run over a step, from the value at its begin to that at its end."""

from collections.abc import Callable, Mapping

import numpy as np

from .participant import Ports, Ramp, Values


class Ramps:
    """The ramps of the next step until it starts, and after it the values that the inputs have reached.

    A unit keeps the value that an input had at a step's begin; what is recorded of it is the one at the step's end.
    """

    def __init__(self) -> None:
        self._next: dict[str, Ramp] = {}
        self._ends: dict[str, Values] = {}

    def add(self, name: str, ramp: Ramp) -> None:
        """Let the input `name` run over the next step."""
        self._next[name] = ramp

    def forget(self, name: str | None = None) -> None:
        """The input `name` was set to a constant value, or all inputs were."""
        if name is None:
            self._ends.clear()
        else:
            self._ends.pop(name, None)

    def take(self) -> Mapping[str, Ramp]:
        """The ramps of the step that starts now."""
        ramps, self._next = self._next, {}
        return ramps

    def ended(self, ramps: Mapping[str, Ramp]) -> None:
        """A step with these ramps is done."""
        self._ends = {name: ramp.end for name, ramp in ramps.items()}

    def shown(self, name: str, ports: Ports, values: Values) -> Values:
        """What an input is at present, of which the participant has `values`."""
        if name in self._ends:
            return self._ends[name]
        shown = values
        for end, value in self._ends.items():
            place = ports.place(end)
            if place is not None and place[0].name == name:
                shown = np.array(shown)
                shown.reshape(-1)[place[1]] = value
        return shown


def whole(ramps: Mapping[str, Ramp], ports: Ports, current: Callable[[str], Values]) -> dict[str, Ramp]:
    """The same ramps, those of elements put together to ramps of their arrays, which `current` gives as they are."""
    merged: dict[str, Ramp] = {}
    for name, ramp in ramps.items():
        if name in ports:
            merged[name] = ramp
            continue
        place = ports.place(name)
        if place is None:
            raise KeyError(name)
        array, at = place[0].name, place[1]
        if array not in merged:
            values = current(array)
            merged[array] = Ramp(np.array(values), np.array(values), np.zeros_like(values))
        own = merged[array]
        for target, value in ((own.begin, ramp.begin), (own.end, ramp.end), (own.curvature, ramp.curvature)):
            if target is not None and value is not None:
                target.reshape(-1)[at] = value
    return merged
