"""How much of the tissue has been activated and has recovered in the frames of a run, and when each node was."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .surface import Numbers
from .tissue import shares

# A mean potential that falls by less than this part of the range stays.
_FALL = 0.05

# Of a longer run this many frames are looked at.
_LOOKED_AT = 400


def activation_times(run: StoredRun) -> Values | None:
    """When each node was activated, in ms, NaN where it was not; None for a run that does not tell."""
    last = run.frame("activation_time_ms", len(run.frames_ms) - 1) if len(run.frames_ms) else None
    points = run.points_mm
    if last is None or points is None or last.shape != (len(points),):
        return None
    # The units' number for a node that the wave has not reached is negative.
    return np.where(last < 0.0, np.nan, last)


class Excitation(NamedTuple):
    """Frames, and in each the parts of the tissue that have been activated, and that are at rest again.

    `repolarising` is the frame in which the mean potential is half-way down from its highest to that of the last frame,
    if it goes down by any amount worth mentioning.
    """

    frames: Numbers
    activated: Values
    recovered: Values
    repolarising: int | None


def excitation(run: StoredRun, potential: str) -> Excitation:
    """The parts by what the unit that knows of activations says, or else by what has been above half of the range.

    At rest again is what is below that.
    """
    times = run.frames_ms
    frames = np.unique(np.linspace(0, len(times) - 1, min(len(times), _LOOKED_AT)).round().astype(np.int64))
    # They are read twice, for they need not fit into memory together.
    ends = np.array([[field.min(), field.max()] for field in _fields(run, potential, frames)])
    low, high = ends[:, 0].min(), ends[:, 1].max()
    weights, activation = shares(run), activation_times(run)
    been = np.zeros(len(weights), dtype=bool)
    rows = []
    for number, field in zip(frames, _fields(run, potential, frames), strict=True):
        above = field > 0.5 * (low + high)
        been = been | above if activation is None else activation <= times[number]
        rows.append((been @ weights, (been & ~above) @ weights, field @ weights))
    activated, recovered, mean = np.array(rows).T
    top = int(mean.argmax())
    fall = mean[top] - mean[-1]
    down = top + int((mean[top:] <= mean[top] - 0.5 * fall).argmax())
    return Excitation(frames, activated, recovered, int(frames[down]) if fall > _FALL * (high - low) else None)


def _fields(run: StoredRun, name: str, numbers: Numbers) -> Iterator[Values]:
    for number in numbers:
        yield np.asarray(run.frame(name, int(number)))
