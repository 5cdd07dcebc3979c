"""The class of a run, from what the run itself left: its summary, its time series, and its errors.

The rules, the first that fits counts:

1. *not run*: the settings cannot stand together, the run refused them, or its results could not be written.
2. A run that ended early is *not converged* where an iterated step found no solution. Where a unit failed it is
   *diverged* if disturbances had been growing, and *unit failed* otherwise, as where a process died or a unit ended it.
3. A run with steps that were accepted without having converged is *not converged*.
4. A run in which disturbances grew is *oscillating* where they alternate between exchanges, and *diverged* where they
   do not. So is one that rings on: alternating disturbances last to its end and keep half of their amplitude.
5. A run that errs by more than a tolerance is *inaccurate*.
6. All others are *sound*.

How disturbances grow is measured by the run itself for each exchanged field (`growth` in summary.json), or, where the
study says `growth: modes`, fitted to the time series (`modes`), which is exact for linear systems.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..trial import CRASHED, DONE, REFUSED, Trial
from .accuracy import Judgement
from .map import DIVERGED, INACCURATE, NOT_CONVERGED, NOT_RUN, OSCILLATING, SOUND, UNIT_FAILED
from .modes import Modes, fitted_modes

#: Kinds of growth as summaries have them, the worst first.
_GROWING, _RINGING, _DECAYING = "growing", "ringing", "decaying"

#: What ended a run, as summaries have it.
_COUPLING, _RESULTS = "coupling", "results"

#: The part of its amplitude that a disturbance keeps to the end of a run that rings on.
_KEPT = 0.5

#: Characters of a reason.
_LONGEST = 240


@dataclass(frozen=True)
class Verdict:
    """The class of a run, why, and by which factor per exchange disturbances were seen to grow."""

    kind: str
    reason: str = ""
    measure: float | None = None


@dataclass(frozen=True)
class _Growth:
    """By how much disturbances grew, whether that is beyond what damps them, and whether they alternate."""

    measure: float | None = None
    text: str = ""
    grows: bool = False
    alternates: bool = False
    why: str = ""


def classified(trial: Trial, judgement: Judgement, by_modes: bool = False) -> Verdict:
    """The class of the run that ended as `trial`, whose accuracy was judged; `by_modes` as the study's `growth`."""
    if trial.status == REFUSED:
        return Verdict(NOT_RUN, _first_sentence(trial.reason))
    if trial.status == CRASHED:
        return Verdict(UNIT_FAILED, _first_sentence(trial.reason))
    growth = _growth(trial, by_modes)
    if trial.status != DONE:
        return _ended_early(trial, growth)
    return _unconverged(trial, growth) or _growing(growth) or _accurate(judgement, growth)


def _ended_early(trial: Trial, growth: _Growth) -> Verdict:
    failure = trial.run.summary.get("failure") or {}
    reason = _joined(_first_sentence(trial.reason), growth.text)
    if failure.get("kind") == _RESULTS:
        return Verdict(NOT_RUN, reason)
    if failure.get("kind") == _COUPLING:
        return Verdict(NOT_CONVERGED, reason, growth.measure)
    return Verdict(DIVERGED if growth.grows else UNIT_FAILED, reason, growth.measure)


def _unconverged(trial: Trial, growth: _Growth) -> Verdict | None:
    times = trial.run.summary.get("unconverged_ms") or []
    if not times:
        return None
    steps = trial.run.summary.get("steps")
    reason = f"{len(times)} of {steps} steps were accepted without having converged, the first to {times[0]:g} ms"
    return Verdict(NOT_CONVERGED, _joined(reason, growth.text), growth.measure)


def _growing(growth: _Growth) -> Verdict | None:
    if not growth.grows and not growth.alternates:
        return None
    return Verdict(OSCILLATING if growth.alternates else DIVERGED, growth.text, growth.measure)


def _accurate(judgement: Judgement, growth: _Growth) -> Verdict:
    if judgement.exceeded:
        return Verdict(INACCURATE, judgement.exceeded, growth.measure)
    return Verdict(SOUND, _joined(judgement.unjudged, growth.why), growth.measure)


def _growth(trial: Trial, by_modes: bool) -> _Growth:
    measured = _of_fields(trial.run.summary)
    if not by_modes:
        return measured
    modes = fitted_modes(trial.run.columns)
    if modes.radius is None:
        # What the run itself measured is still there.
        return _Growth(measured.measure, measured.text, measured.grows, measured.alternates, modes.why)
    return _Growth(modes.radius, _told(modes), modes.grows, modes.grows and modes.alternates)


def _told(modes: Modes) -> str:
    if not modes.grows:
        return ""
    turn = f", turning its phase by {modes.angle_deg:.0f}° each time" if modes.alternates else ""
    return f"a disturbance grows by a factor of {modes.radius:.6g} from one exchange to the next{turn}"


def _of_fields(summary: Mapping[str, Any]) -> _Growth:
    """From a run's summary: the field of the worst kind, and among those the one of the largest rate."""
    fields: Mapping[str, Mapping[str, Any]] = summary.get("growth") or {}
    for kind in (_GROWING, _RINGING, _DECAYING):
        of_kind = {name: entry for name, entry in fields.items() if entry["kind"] == kind}
        if of_kind:
            name = max(of_kind, key=lambda each: float(of_kind[each]["rate"]))
            entry = of_kind[name]
            alternates = f"{name} alternates with a period of {entry['period_steps']} steps"
            rate = float(entry["rate"])
            if kind == _GROWING:
                return _Growth(rate, f"{alternates} and grows by a factor of {rate:.4g} per step", True, True)
            if kind == _RINGING and _lasts(entry, summary):
                return _Growth(
                    rate, f"{alternates} and keeps ringing, with a factor of {rate:.4g} per step", False, True
                )
            return _Growth(rate)
    return _Growth()


def _lasts(entry: Mapping[str, Any], summary: Mapping[str, Any]) -> bool:
    """Whether what rings goes on to the end of the run, and keeps its amplitude meanwhile."""
    step = float(summary["end_ms"]) / int(summary["steps"])
    goes_on = float(entry["to_ms"]) > float(summary["end_ms"]) - 1.5 * step
    return goes_on and float(entry["rate"]) ** ((float(entry["to_ms"]) - float(entry["from_ms"])) / step) > _KEPT


def _first_sentence(text: str) -> str:
    """Of a message that also says what to try."""
    sentence = text.strip().split("\n", 1)[0].split("; ", 1)[0].split(". ", 1)[0].rstrip(".")
    return sentence if len(sentence) <= _LONGEST else f"{sentence[: _LONGEST - 3]}..."


def _joined(*texts: str) -> str:
    return "; ".join(text for text in texts if text)
