"""The communication points of an experiment, and the rows of its results at them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .experiment import Experiment
from .unverified import Unverified

#: How far a time may be from the communication point that it is taken for, relative to the step.
_SAME = 1e-6

#: More steps are a slip of the pen, or meant to take for ever.
_MOST_STEPS = 1_000_000


@dataclass(frozen=True)
class Communication:
    """Communication points in s, shape (points,), the sizes of the steps between, and the rows of results by point.

    Results may end before the last point where the FMU ends the simulation there: `is_whole` tells if they do not.
    """

    points: NDArray[np.float64]
    sizes: NDArray[np.float64]
    rows: dict[int, int]
    is_whole: bool


def communication(experiment: Experiment, times: NDArray[np.float64]) -> Communication:
    """The communication of `experiment`, whose results are at `times`; without a step, those are its points.

    Unverified where the times begin elsewhere, or are not all communication points.
    """
    start = experiment.start_s
    stop = float(times[-1]) if experiment.stop_s is None else experiment.stop_s
    if experiment.step_s is None:
        # A step to the end shows whether the FMU goes on where its results do not.
        points = np.append(times, stop) if stop - times[-1] > _SAME * (stop - start) else times
        sizes = np.diff(points)
    else:
        points, sizes = _grid(start, stop, experiment.step_s)
    if not sizes.size:
        raise Unverified(f"its results end at its start, at {start:g} s")
    rows: dict[int, int] = {}
    scale = float(sizes[0])
    for row, time in enumerate(times.tolist()):
        nearest = _nearest(points, time)
        if abs(points[nearest] - time) > _SAME * scale:
            raise Unverified(
                f"the results have a row at {time:.12g} s, which is not a communication point of the experiment (from "
                f"{start:g} to {stop:g} s in steps of {scale:g} s)"
            )
        if nearest in rows:
            raise Unverified(f"the results have two rows at the communication point {time:.12g} s")
        rows[nearest] = row
    if abs(times[0] - start) > _SAME * scale:
        raise Unverified(f"the results begin at {times[0]:.12g} s, and the experiment at {start:g} s")
    if experiment.step_s is None and times[-1] > stop + _SAME * scale:
        raise Unverified(f"the results continue to {times[-1]:.12g} s, after the experiment's end at {stop:g} s")
    return Communication(points, sizes, rows, is_whole=bool(times[-1] >= stop - _SAME * scale))


def _grid(start: float, stop: float, step: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = (stop - start) / step
    if count > _MOST_STEPS:
        raise Unverified(f"its {count:.3g} steps are more than the {_MOST_STEPS} that are run at most")
    whole = round(count) if abs(count - round(count)) <= _SAME else int(count)
    points = [start + step * number for number in range(whole + 1)]
    sizes = [step] * whole
    if count - whole > _SAME:
        sizes.append(stop - points[-1])
        points.append(stop)
    return np.array(points), np.array(sizes)


def _nearest(points: NDArray[np.float64], time: float) -> int:
    place = int(np.searchsorted(points, time))
    candidates = [each for each in (place - 1, place) if 0 <= each < len(points)]
    return min(candidates, key=lambda each: abs(points[each] - time))
