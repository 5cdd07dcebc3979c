"""The frames that are drawn of a run: those in which something happens, or those nearest to the times asked for."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...orchestrator.errors import InputError
from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .excitation import excitation
from .layout import COLUMNS

#: Parts of the tissue at whose excitation and recovery a frame is drawn.
_ACTIVATED, _RECOVERED = (0.1, 0.5, 0.9), (0.5, 0.9)

# A cavity that loses less than this part of its volume does not contract.
_LEAST_CONTRACTION = 0.01


class Frame(NamedTuple):
    """The number of a stored frame, its time, and why it is shown."""

    number: int
    time_ms: float
    reason: str

    @property
    def title(self) -> str:
        """What stands above its picture."""
        time = f"{round(self.time_ms, 3):g} ms"
        return f"{time}: {self.reason}" if self.reason else time


def at_times(run: StoredRun, times_ms: Sequence[float]) -> list[Frame]:
    """The frames nearest to `times_ms`, each once, in the order of time.

    Raises
    ------
    InputError
        For a time outside the run.
    """
    stored = run.frames_ms
    chosen: dict[int, str] = {}
    for time in sorted(times_ms):
        if not stored[0] <= time <= max(stored[-1], run.end_ms):
            raise InputError(
                f"{run.folder}: no frame of {time:g} ms can be shown, for the run has frames from {stored[0]:g} to "
                f"{stored[-1]:g} ms; ask for times in between"
            )
        number = int(np.abs(stored - time).argmin())
        exact = math.isclose(stored[number], time, abs_tol=1e-6)
        chosen.setdefault(number, "" if exact else f"nearest to {time:g} ms")
    return [Frame(number, float(stored[number]), reason) for number, reason in chosen.items()]


def of_a_beat(run: StoredRun, potential: str, displacement: str) -> list[Frame]:
    """Frames of activation, contraction and repolarisation, as far as the run went, in the order of time.

    Parameters
    ----------
    potential, displacement:
        Names of the fields at the nodes; that there is none of displacements only means that nothing moves.
    """
    times = run.frames_ms
    chosen: dict[int, list[str]] = {}

    def add(number: int, reason: str) -> None:
        chosen.setdefault(number, []).append(reason)

    add(0, "start")
    if len(times) > 1:
        add(1, "first after the start")
    tissue = excitation(run, potential)
    parts = (("activated", tissue.activated, _ACTIVATED), ("repolarised", tissue.recovered, _RECOVERED))
    for label, part, wanted in parts:
        for share in wanted:
            # Rounding must not keep the last node from being counted.
            reached = np.flatnonzero(part >= share - 1e-9)
            if len(reached):
                add(int(tissue.frames[reached[0]]), f"{100.0 * share:g} % {label}")
    if tissue.repolarising is not None and tissue.recovered.max() < _RECOVERED[0]:
        add(tissue.repolarising, "repolarising")
    contraction = greatest_contraction(run, displacement)
    if contraction is not None:
        add(contraction.number, contraction.reason)
    if len(times) > 2:
        add(len(times) - 1, "end of the run" if run.summary.get("status", "done") == "done" else "last frame")
    named = {number: ", ".join(reasons) for number, reasons in chosen.items()}
    return [Frame(number, float(times[number]), named[number]) for number in _with_more(named, times)]


def _with_more(chosen: dict[int, str], times_ms: Values) -> list[int]:
    """The chosen frames in order, and where they do not fill their rows, more half-way through the longest gaps."""
    numbers = sorted(chosen)
    while len(numbers) > COLUMNS and len(numbers) % COLUMNS:
        gaps = np.diff(times_ms[numbers])
        for place in np.argsort(-gaps, kind="stable"):
            first, last = numbers[place], numbers[place + 1]
            if last - first > 1:
                middle = 0.5 * (times_ms[first] + times_ms[last])
                between = first + 1 + int(np.abs(times_ms[first + 1 : last] - middle).argmin())
                chosen[between] = "in between"
                numbers = sorted(chosen)
                break
        else:
            break
    return numbers


def greatest_contraction(run: StoredRun, displacement: str) -> Frame | None:
    """The frame of the smallest volume of the cavities, or without any of the largest displacement; None at rest."""
    times = run.frames_ms
    volumes = [volume for name, volume in run.columns.items() if name.endswith("_volume_ml") and np.any(volume > 0.0)]
    if volumes:
        total = np.sum(volumes, axis=0)
        known = np.flatnonzero(np.isfinite(total))
        least = known[total[known].argmin()] if len(known) else 0
        if len(known) and total[least] < (1.0 - _LEAST_CONTRACTION) * total[known[0]]:
            number = int(np.abs(times - run.columns["time_ms"][least]).argmin())
            return Frame(number, float(times[number]), "greatest contraction")
        return None
    sizes = displacement_sizes(run, displacement)
    if sizes is None or not sizes.any():
        return None
    number = int(sizes.argmax())
    return Frame(number, float(times[number]), "largest displacement")


def displacement_sizes(run: StoredRun, displacement: str) -> Values | None:
    """The largest displacement in mm of each frame, shape (frames,); None for a run without that field."""
    if run.frame(displacement, 0) is None:
        return None
    fields = (np.asarray(run.frame(displacement, number)) for number in range(len(run.frames_ms)))
    return np.array([np.linalg.norm(field, axis=1).max() for field in fields])


def of_a_load(run: StoredRun, displacement: str) -> list[Frame]:
    """The first frame, and those in which the displacement has first reached fifths of its largest; empty at rest."""
    sizes = displacement_sizes(run, displacement)
    if sizes is None or not sizes.any():
        return []
    chosen = {0: "start", int(sizes.argmax()): "largest displacement"}
    for percent in (20, 40, 60, 80):
        # Rounding must not keep a frame that reaches it exactly from being counted.
        reached = int((sizes >= (0.01 * percent - 1e-9) * sizes.max()).argmax())
        chosen.setdefault(reached, f"{percent} % of the largest displacement")
    return [Frame(number, float(run.frames_ms[number]), chosen[number]) for number in sorted(chosen)]
