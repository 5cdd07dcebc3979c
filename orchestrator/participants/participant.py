"""What the master couples: anything that has ports, can be initialised, and steps in time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Port:
    """An input or output of a participant, as far as the master needs to know it.

    `unit` is the unit of measure, None where an FMU declares none. `location` is `node`, `element` or `global`, None
    where unknown. A `fixed` port is exchanged once, at initialisation. A port that is not `live` has no influence with
    the parameters given, because the one it `needs` is zero, and is not connected. `record` says what a time series
    keeps: `value`, `probes`. A number that is drawn from a field, such as its mean, is `of` that output.
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

    @property
    def size(self) -> int:
        """Number of scalars."""
        return int(np.prod(self.shape))

    @property
    def column(self) -> str:
        """The port's name with its unit of measure: `potential_mV`."""
        return self.name if self.unit in (None, "1") else f"{self.name}_{str(self.unit).replace('/', '_per_')}"


@dataclass(frozen=True)
class Ramp:
    """How an input runs over the next step: from `begin` to `end`, by its second derivative in 1/s² if there is one."""

    begin: Values
    end: Values
    curvature: Values | None = None


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


#: Waits for the end of a step that was started, and raises what went wrong in it. Returns the seconds that the step
#: took, where only the participant knows; None where it was done when it was started.
Wait = Callable[[], float | None]


class Participant(Protocol):
    """One unit in the coupled time loop. All calls raise ParticipantError, InputError for what the person gave."""

    name: str
    inputs: dict[str, Port]
    outputs: dict[str, Port]
    abilities: Abilities

    def begin(self) -> None:
        """Set the experiment up and enter the initialization mode."""

    def complete(self) -> None:
        """Exit the initialization mode: outputs have their initial values."""

    def set(self, name: str, values: Values) -> None:
        """Set an input."""

    def ramp(self, name: str, ramp: Ramp) -> None:
        """Let an input run over the next step, if the participant ramps; replaces `set` for that step."""

    def get(self, name: str) -> Values:
        """An output's values, of the port's shape; the array is the caller's."""

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

    def close(self) -> None:
        """Terminate and release everything; never raises."""


Parameters = dict[str, Any]
