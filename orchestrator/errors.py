"""The ways a run ends early, and the hint that goes with a misspelt name."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

from .quoting import shortened
from .stopwatch import Usage


class InputError(Exception):
    """What the person gave is wrong (exit code 2). The message names the file, the key and the remedy."""


class RunError(Exception):
    """The physics, the coupling or the operating system failed (exit code 3).

    The message says which unit, when, why and what to try. `kind` is what failed: a `unit`, then its name is `unit`;
    the `coupling`; the `results`, which cannot be written; or none of these, a unit has `terminated` the simulation.
    `time_ms` is the end of the step that was not accepted, where it was one. Where an iteration failed, `sweeps` are
    those (coupling.schemes.Sweeps) of that step.
    """

    kind: str = "coupling"
    unit: str | None = None
    time_ms: float | None = None
    sweeps: Any = None


class Terminated(RunError):
    """A unit requested the end of the simulation before the stop time."""


class Interrupted(Exception):
    """Somebody asked the run to stop by the signal of number `signal`; the results so far are complete."""

    def __init__(self, signal: int) -> None:
        super().__init__(f"stopped by signal {signal}")
        self.signal = signal
        #: Whether the run can be gone on with; known when the results are closed.
        self.resumable = False


class ParticipantError(Exception):
    """A participant could not do what the master asked; the master adds when it was.

    `unit` is the name of the participant, as soon as it is known; `usage` is what the call took until it failed, where
    only the participant knows.
    """

    unit: str | None = None
    usage: Usage | None = None


class ParticipantLost(ParticipantError):
    """A participant is lost: its process died, it did not return in time, or FMI forbids further calls."""


class ParticipantTerminated(ParticipantError):
    """A participant requests the end of the simulation; `time_s` is the last time it reached, where it says so."""

    time_s: float | None = None


class NotConverged(Exception):
    """The iteration of a loop found no solution of the step; the master adds when it was.

    `sweeps` (coupling.schemes.Sweeps) is the history of the step's loops, this one included.
    """

    def __init__(self, message: str, sweeps: Any) -> None:
        super().__init__(message)
        self.sweeps = sweeps


#: Characters of a name, and known names, that a hint repeats.
_LONGEST, _MOST = 200, 30


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean 'x'?` with the nearest known name, or the list of the known ones."""
    names = sorted(known)
    # Comparing takes time that grows with the length.
    near = get_close_matches(name, names, n=1, cutoff=0.5) if len(name) <= _LONGEST else []
    if near:
        return f"; did you mean '{shortened(near[0], _LONGEST)}'?"
    listed = ", ".join(shortened(each, _LONGEST) for each in names[:_MOST])
    if len(names) > _MOST:
        listed += f", ... {len(names)} in all"
    return f" (known: {listed or 'none'})"
