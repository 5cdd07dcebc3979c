"""What the cells of a map are compared with: every reference run once, however many cells share it."""

from collections.abc import Iterable
from pathlib import Path

from ...orchestrator.results.stored_run import StoredRun
from ..bench import Bench
from ..chart.charted import stored_results
from ..plan import Reference
from .plan_map import Place


class References:
    """Those that were run on `bench`, or read; `origin` is the study's file."""

    def __init__(self, bench: Bench, origin: str) -> None:
        self._bench = bench
        self._origin = origin
        self._found: dict[str, StoredRun | str] = {}

    @property
    def runs(self) -> list[StoredRun]:
        """All that have results to the end."""
        return [found for found in self._found.values() if isinstance(found, StoredRun)]

    def run(self, places: Iterable[Place]) -> None:
        """Run those of `places` that are missing; InputError for results that are said to be there, and are not.

        One that fails is no error: the cells that need it say so.
        """
        named = [place.reference for place in places if isinstance(place.reference, Reference)]
        missing = {key: reference for reference in named if (key := _key(reference)) not in self._found}
        points = {key: reference.point for key, reference in missing.items() if reference.point is not None}
        trials = self._bench.run(points.values(), "references") if points else []
        for key, trial in zip(points, trials, strict=True):
            self._found[key] = trial.run if trial.is_done else f"its reference {trial.status}: {trial.reason}"
        for key, reference in missing.items():
            if reference.point is None:
                self._found[key] = stored_results(reference, self._origin)

    def of(self, place: Place) -> StoredRun | str | None:
        """The results that a place is compared with; a text says why there are none, None that none are asked for."""
        if isinstance(place.reference, Reference):
            return self._found[_key(place.reference)]
        return place.reference

    def folder(self, place: Place) -> Path | None:
        """Where the results of the same body are, if there are any: on another mesh fields mean nothing here."""
        run = self.of(place)
        if not isinstance(run, StoredRun) or place.point is None:
            return None
        ours = place.point.scenario.resolved().get("scene")
        return run.folder if run.summary.get("scenario", {}).get("scene") == ours else None


def _key(reference: Reference) -> str:
    return str(reference.folder) if reference.point is None else reference.point.key
