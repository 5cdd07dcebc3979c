"""By how much the results of two runs differ: one number for each quantity, in the quantity's unit of measure.

Curves and fields are compared at the times that both runs have, to the nanosecond, so that no interpolation in time
adds an error of its own: output times are hit exactly by every coupling.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from ..participants.participant import Values
from .stored_run import StoredRun

#: The measure of the activation at the probes.
ACTIVATION = "activation_ms"

#: How far two times in ms may be apart and still be the same.
_SAME_MS = 1e-6

#: Units of measure as names end in them.
_UNITS = ("ms", "mV", "mm", "ml", "kPa", "deg")

#: A field of the times of events, which has no value where nothing has happened yet.
_EVENTS = "_time_ms"


@dataclass(frozen=True)
class Difference:
    """`value` in the measure's unit: infinite where only one run has the quantity, NaN where none can be determined.

    `why` says so in words, for both. `time_ms` is when the difference is that large, where it is of a moment.
    """

    value: float
    why: str = ""
    time_ms: float | None = None


@dataclass(frozen=True)
class Measure:
    """A quantity by which runs are compared; `unit` is its unit of measure, empty where that is not known."""

    name: str
    unit: str
    description: str
    between: Callable[[StoredRun, StoredRun], Difference]


def measures(run: StoredRun, still: bool = False) -> dict[str, Measure]:
    """All measures that `run` has, by name; with `still` also those of quantities that never change.

    `activation_ms` is the largest difference of the activation at any probe. Every column of numbers in the time
    series gives the largest difference at any time, and every field that moves the root mean square over its nodes or
    elements, at the time at which that is largest. Of a field of times (`activation_time_ms`) the last frame counts.
    What never changes measures nothing where all runs are alike, and is left out.
    """
    found = {}
    times = run.summary.get("activation_time_ms") or {}
    if any(time is not None for time in times.values()):
        found[ACTIVATION] = Measure(ACTIVATION, "ms", "activation at the probes, largest difference", _activation)
    for column, values in run.columns.items():
        known = values[np.isfinite(values)]
        if column != "time_ms" and len(known) and (still or np.any(known != known[0])):
            text = f"{spoken(column)}, largest difference at any time"
            found[column] = Measure(column, unit_of(column), text, partial(_curve, column))
    for name in run.moving if still else filter(partial(_moves, run), run.moving):
        compare: Callable[[str, StoredRun, StoredRun], Difference] = _events if name.endswith(_EVENTS) else _field
        when = "at the end" if name.endswith(_EVENTS) else "at the worst time"
        text = f"{spoken(name)}, root mean square over the mesh {when}"
        found[name] = Measure(name, unit_of(name), text, partial(compare, name))
    return found


def unit_of(name: str) -> str:
    """The unit of measure that a name ends in; empty where it ends in none."""
    last = name.rpartition("_")[2]
    return last if last in _UNITS else ""


def stem_of(name: str) -> str:
    """A name without the unit of measure that it ends in."""
    unit = unit_of(name)
    return name.removesuffix(f"_{unit}") if unit else name


def spoken(name: str) -> str:
    """A name for a person, without its unit of measure."""
    return stem_of(name).replace("_", " ")


def _moves(run: StoredRun, name: str) -> bool:
    """Whether a field changes from the first frame to any other; the last one is looked at first."""
    frames = range(len(run.frames_ms) - 1, 0, -1)
    return any(not np.array_equal(_part(run, name, 0), _part(run, name, frame)) for frame in frames)


def _activation(run: StoredRun, reference: StoredRun) -> Difference:
    ours, theirs = (each.summary.get("activation_time_ms") or {} for each in (run, reference))
    apart = [0.0]
    for probe, time in theirs.items():
        own = ours.get(probe)
        if (own is None) != (time is None):
            which = "never" if own is None else "activated, but not in the reference"
            return Difference(inf, f"the probe {probe} is {which}{' activated' if own is None else ''}")
        if own is not None and time is not None:
            apart.append(abs(own - time))
    return Difference(max(apart))


def _curve(column: str, run: StoredRun, reference: StoredRun) -> Difference:
    if column not in run.columns:
        return Difference(nan, f"the run has no {column}")
    here, there = _common(run.columns["time_ms"], reference.columns["time_ms"])
    apart = np.abs(run.columns[column][here] - reference.columns[column][there])
    # Units that step less often leave gaps.
    if not np.isfinite(apart).any():
        return Difference(nan, f"the runs have no time in common for {column}")
    row = int(np.argmax(np.where(np.isfinite(apart), apart, -inf)))
    return Difference(float(apart[row]), time_ms=float(reference.columns["time_ms"][there[row]]))


def _field(name: str, run: StoredRun, reference: StoredRun) -> Difference:
    count, why = _shared(name, run, reference)
    if why:
        return Difference(nan, why)
    here, there = _common(run.frames_ms, reference.frames_ms)
    apart = []
    for own, other in zip(here.tolist(), there.tolist(), strict=True):
        difference = _part(run, name, own, count) - _part(reference, name, other, count)
        apart.append(float(np.sqrt((difference * difference).sum() / count)))
    if not apart:
        return Difference(nan, f"the runs have no time in common for {name}")
    frame = int(np.argmax(apart))
    return Difference(apart[frame], time_ms=float(reference.frames_ms[there[frame]]))


def _events(name: str, run: StoredRun, reference: StoredRun) -> Difference:
    count, why = _shared(name, run, reference)
    here, there = _common(run.frames_ms, reference.frames_ms)
    if why or not len(here):
        return Difference(nan, why or f"the runs have no time in common for {name}")
    ours, theirs = _part(run, name, int(here[-1]), count), _part(reference, name, int(there[-1]), count)
    happened = (ours >= 0.0) & (theirs >= 0.0)
    alone = int(((ours >= 0.0) != (theirs >= 0.0)).sum())
    if alone:
        return Difference(inf, f"{alone} of {count} places have a time in only one of the runs")
    apart = (ours - theirs)[happened]
    return Difference(float(np.sqrt((apart * apart).mean())) if len(apart) else 0.0)


def _shared(name: str, run: StoredRun, reference: StoredRun) -> tuple[int, str]:
    """How many places of a field the two runs have in common, and why none where there are none.

    Nodes of a mesh that was refined from another begin with those of the other one.
    """
    if name not in run.moving or name not in reference.moving:
        return 0, f"one of the runs has no {name}"
    if not len(run.frames_ms) or not len(reference.frames_ms):
        return 0, f"one of the runs has no frames of {name}"
    own, other = run.points_mm, reference.points_mm
    sizes = [len(_part(each, name, 0)) for each in (run, reference)]
    if own is not None and other is not None:
        shared = min(len(own), len(other))
        nested = np.allclose(own[:shared], other[:shared], rtol=0.0, atol=1e-9)
        if nested and (sizes[0] == sizes[1] or sizes == [len(own), len(other)]):
            return min(sizes), ""
    return 0, f"{name} is on another mesh, so only probes and curves can be compared"


def _part(run: StoredRun, name: str, frame: int, count: int | None = None) -> Values:
    values = run.frame(name, frame)
    if values is None:
        raise KeyError(name)
    return values[:count]


def _common(one: Values, other: Values) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The places in two rising sequences of times in ms at which these are the same."""
    if not len(one) or not len(other):
        nothing = np.empty(0, np.intp)
        return nothing, nothing
    right = np.clip(np.searchsorted(other, one), 1, max(len(other) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(other) - 1)
    nearest = np.where(np.abs(other[right] - one) < np.abs(other[left] - one), right, left)
    same = np.abs(other[nearest] - one) <= _SAME_MS
    return np.flatnonzero(same), nearest[same]


def headlines(run: StoredRun) -> dict[str, float]:
    """The headline numbers of a run, by name: activation at the probes, smallest volumes, ejection fractions.

    Of every other number in the time series it is the value farthest from that at the start. Probes that are not
    activated are left out.
    """
    summary: Mapping[str, object] = run.summary
    activation = summary.get("activation_time_ms")
    found: dict[str, float] = {}
    if isinstance(activation, dict):
        found |= {f"activation_{probe}_ms": float(time) for probe, time in activation.items() if time is not None}
    for column in run.columns:
        extent = summary.get(column)
        if not isinstance(extent, dict) or not {"start", "min", "max"} <= extent.keys():
            continue
        start, low, high = (float(extent[key]) for key in ("start", "min", "max"))
        which, value = ("min", low) if start - low > high - start else ("max", high)
        if high > low:
            unit = unit_of(column)
            stem = stem_of(column)
            found[f"{stem}_{which}_{unit}" if unit else f"{stem}_{which}"] = value
    fractions = summary.get("ejection_fraction")
    if isinstance(fractions, dict):
        found |= {f"{chamber}_ejection_fraction": float(value) for chamber, value in fractions.items() if value > 0.0}
    return found
