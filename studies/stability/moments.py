"""The moments of a run by the names that theories know: what its fields were at its output times."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from ...orchestrator.participants.native import Moment
from ...orchestrator.results.stored_run import StoredRun

#: The fields of a moment, by their names in results.
_CHANGING = {
    "stretch": "stretch",
    "active_stress": "active_stress_kPa",
    "displacement": "displacement_mm",
    "potential": "potential_mV",
}
_FIXED = ("fiber", "sheet")

#: Runs whose moments are kept: those of neighbours on a map are mostly the same.
_KEPT = 4


@lru_cache(maxsize=_KEPT)
def moments_in(folder: Path) -> Sequence[Moment]:
    """The moments of the run in `folder`, which is done; a field that it does not have is missing there."""
    run = StoredRun(folder)
    fixed = {name: values for name in _FIXED if (values := run.initial(name)) is not None}
    return [_moment(run, number, fixed) for number in range(len(run.frames_ms))]


def _moment(run: StoredRun, number: int, fixed: Moment) -> Moment:
    return dict(fixed) | {
        name: values for name, stored in _CHANGING.items() if (values := run.frame(stored, number)) is not None
    }
