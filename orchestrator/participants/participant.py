"""What the master couples: anything that has ports, can be initialised, and steps in time."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, did_you_mean
from ..stopwatch import Usage

#: Numbers of whatever type, or texts; those of real ports are float64.
Values = NDArray[Any]

#: A name with indices, and what comes before them.
INDEXED = re.compile(r"^(.+)\[((?:0|[1-9][0-9]{0,9})(?:,(?:0|[1-9][0-9]{0,9}))*)\]$", re.DOTALL)

#: Types of real numbers, as `Port.type` has them.
_REAL = ("Real", "Float32")


@dataclass(frozen=True)
class Port:
    """An input or output of a participant, as far as the master needs to know it.

    `unit` is the unit of measure, None where an FMU declares none. `location` is `node`, `element` or `global`, None
    where unknown. A `fixed` port is exchanged once, at initialisation. A port that is not `live` has no influence with
    the parameters given, because the one it `needs` is zero, and is not connected by its name. `record` says what a
    time series keeps: `value`, `probes`. A number that is drawn from a field, such as its mean, is `of` that output.

    `type` is that of FMI; Float64 is a Real here. A `discrete` port changes at events only: it is held between
    exchanges. An enumeration has `items`, the numbers it can be. Elements of an array are counted from `base`.
    What an input starts with is no more than a `stand_in` where only another unit knows what it is.
    """

    name: str
    unit: str | None
    shape: tuple[int, ...]
    location: str | None = None
    fixed: bool = False
    live: bool = True
    record: str = "nothing"
    needs: str | None = None
    of: str | None = None
    type: str = "Real"
    discrete: bool = False
    items: tuple[int, ...] = ()
    base: int = 1
    stand_in: bool = False

    @property
    def is_real(self) -> bool:
        """Whether its values are real numbers."""
        return self.type in _REAL

    @property
    def elements(self) -> Iterator[str]:
        """The names of its scalars in row-major order: `u[1,1]`, `u[1,2]`, …; its own name if it is a scalar."""
        if not self.shape:
            yield self.name
            return
        for indices in product(*(range(self.base, self.base + count) for count in self.shape)):
            yield f"{self.name}[{','.join(map(str, indices))}]"

    @property
    def size(self) -> int:
        """Number of scalars."""
        return int(np.prod(self.shape))

    @property
    def column(self) -> str:
        """The port's name with its unit of measure, if it does not end in that already: `potential_mV`."""
        suffix = "" if self.unit in (None, "1") else f"_{str(self.unit).replace('/', '_per_')}"
        return self.name if self.name.endswith(suffix) else f"{self.name}{suffix}"


class Ports(dict[str, Port]):
    """Ports by name. The element of an array, `u[2]`, is found by its name as well, but is none of the ports."""

    def place(self, name: str) -> tuple[Port, int] | None:
        """The array that has the element `name`, and the place of that in row-major order; None if none has."""
        match = INDEXED.match(name)
        port = None if match is None else self.get(match[1])
        if match is None or port is None:
            return None
        indices = tuple(int(index) - port.base for index in match[2].split(","))
        if len(indices) != len(port.shape) or not all(
            0 <= index < count for index, count in zip(indices, port.shape, strict=True)
        ):
            return None
        return port, int(np.ravel_multi_index(indices, port.shape))

    def __missing__(self, name: str) -> Port:
        found = self.place(name)
        if found is None:
            raise KeyError(name)
        return replace(found[0], name=name, shape=(), location=None, record="value", of=None)

    def known(self, name: str) -> bool:
        """Whether there is a port, or an element of one, of this name."""
        return name in self or self.place(name) is not None

    def chosen(self, patterns: Iterable[str], what: str) -> "Ports":
        """The ports, and elements of them, that `patterns` choose: names, or with `*` and `?` for any characters.

        InputError for a pattern that chooses nothing of `what`.
        """
        found = Ports()
        for pattern in patterns:
            if self.known(pattern):
                found[pattern] = self[pattern]
                continue
            # A bracket is one, and does not begin a set of characters.
            names = [name for name in self if fnmatchcase(name, pattern.replace("[", "[[]"))]
            if not names:
                raise InputError(f"output.variables: {what} has no variable '{pattern}'{did_you_mean(pattern, self)}")
            found.update((name, self[name]) for name in names)
        return found

    def element(self, name: str, whole: Callable[[str], Values]) -> Values:
        """The value of the element `name`, out of the `whole` array."""
        found = self.place(name)
        if found is None:
            raise KeyError(name)
        return np.asarray(whole(found[0].name).reshape(-1)[found[1]])

    def with_element(self, name: str, value: Values, whole: Callable[[str], Values]) -> tuple[str, Values]:
        """The array that has the element `name`, and what it is with that `value` in place of what it has."""
        found = self.place(name)
        if found is None:
            raise KeyError(name)
        values = np.array(whole(found[0].name))
        values.reshape(-1)[found[1]] = value
        return found[0].name, values


@dataclass(frozen=True)
class Ramp:
    """How an input runs over the next step: from `begin` to `end`, by its second derivative in 1/s² if there is one."""

    begin: Values
    end: Values
    curvature: Values | None = None

    def slope(self, size: float) -> Values:
        """The difference quotient over a step of `size` s, in 1/s."""
        return np.asarray((self.end - self.begin) / size)

    def reached(self, size: float) -> Values:
        """The end as it is computed from the begin and the slope: all participants arrive there to the bit."""
        return np.asarray(self.begin + size * self.slope(size))

    def value(self, offset: float, size: float) -> Values:
        """The value `offset` s after the begin of a step of `size` s."""
        if self.curvature is None or offset == size:
            return np.asarray(self.begin + offset * self.slope(size))
        first = self.slope(size) - 0.5 * size * self.curvature
        return np.asarray(self.begin + offset * first + 0.5 * offset**2 * self.curvature)


@dataclass(frozen=True)
class Abilities:
    """What a participant can do beyond stepping.

    `rolls_back`: save and restore its state; `serializes`: turn a state into bytes and back; `ramps`: follow inputs
    that change inside a step; `any_step_size`: take steps of changing size. One that is `memoryless` follows its
    inputs whatever was before, so that it need not be stepped when nobody looks.
    """

    rolls_back: bool = True
    serializes: bool = True
    ramps: bool = False
    any_step_size: bool = True
    memoryless: bool = False


@dataclass(frozen=True)
class Implementation:
    """What a participant computes with on its machine: kernels, instruction set, linear solver.

    Bits differ between those of different `text`. `fallbacks` are sentences on what is slower than it need be, each
    with the remedy. Who says nothing of it, as foreign FMUs do not, has an empty text.
    """

    text: str = ""
    fallbacks: tuple[str, ...] = ()


#: Waits for the end of a step that was started, and raises what went wrong in it. Returns what the step took, where
#: only the participant knows; None where this thread had done it when it was started.
Wait = Callable[[], Usage | None]


class Participant(Protocol):
    """One unit in the coupled time loop. All calls raise ParticipantError, InputError for what the person gave.

    An element of an array is set, ramped and got like a scalar, by its own name. `observed` are variables of any kind
    that were asked for to be recorded, in addition to inputs and outputs; `get` gives their values too.
    """

    name: str
    inputs: Ports
    outputs: Ports
    observed: Ports
    abilities: Abilities

    def begin(self) -> Usage | None:
        """Set the experiment up and enter the initialization mode; what that took, where this thread did not do it."""

    def complete(self) -> Usage | None:
        """Exit the initialization mode: outputs have their initial values; what that took, as for `begin`."""

    def set(self, name: str, values: Values) -> None:
        """Set an input."""

    def ramp(self, name: str, ramp: Ramp) -> None:
        """Let an input run over the next step, if the participant ramps; replaces `set` for that step."""

    def get(self, name: str) -> Values:
        """An output's values, of the port's shape; the array is the caller's.

        Real numbers come as float64, whole ones as int64 or uint64, Booleans as bool, texts as NumPy's.
        """

    def start(self, time: float, size: float) -> Wait:
        """Start to advance from `time` by `size`, both in s; nothing else may be called before the wait is over."""

    def save(self) -> Any:
        """The state at this moment, if the participant rolls back; to be given to `free` in the end."""

    def restore(self, state: Any) -> None:
        """Go back to a saved state: the next step is then the one that was taken from there, to the bit."""

    def free(self, state: Any) -> None:
        """Give a saved state up."""

    def pack(self) -> bytes:
        """The state at this moment as bytes, if the participant serializes."""

    def unpack(self, data: bytes) -> None:
        """Go to the state that `pack` gave, perhaps in another process."""

    def implementation(self) -> Implementation:
        """What it computes with, once it is initialised."""

    def log_to(self, path: Path) -> None:
        """Write what it logs to the end of the file at `path` from now on, and what it has logged so far."""

    def close(self) -> None:
        """Terminate and release everything; never raises."""


Parameters = dict[str, Any]
