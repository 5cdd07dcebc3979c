"""The runs of a budget: a scenario with some settings, each run once, and the headlines of its results."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ...orchestrator.errors import InputError, RunError
from ...orchestrator.results.comparison import headlines
from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.scenario import Contradiction
from ..bench import Bench
from ..plan import Variants
from ..point import Point, told
from ..trial import REFUSED
from .source import Settings


@dataclass(frozen=True)
class Tried:
    """The headlines of a run and its processor seconds; none, and the `reason`, where it has no results."""

    values: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    reason: str = ""


class Runs:
    """Those of `variants` on the `bench`; `known` are results of the scenario itself, which need not be run again."""

    def __init__(self, variants: Variants, bench: Bench, known: StoredRun | None = None) -> None:
        self._variants = variants
        self._bench = bench
        self._tried: dict[str, Tried] = {}
        if known is not None:
            self._tried[_key({})] = Tried(headlines(known), known.summary["cpu_s"]["total"])

    def base(self) -> Tried:
        """The scenario as it is; InputError or RunError where it has no results."""
        if _key({}) not in self._tried:
            (trial,) = self._bench.run([self._point({})], "the scenario itself")
            if not trial.is_done:
                raise (InputError if trial.status == REFUSED else RunError)(trial.reason)
            self._tried[_key({})] = Tried(headlines(trial.run), trial.cpu_s)
        return self[{}]

    def run(self, wanted: Iterable[Settings], title: str) -> None:
        """Run what was not run yet. What cannot be run, or fails, has a reason afterwards."""
        points = dict[str, Point]()
        for settings in wanted:
            key = _key(settings)
            if key not in self._tried and key not in points:
                try:
                    points[key] = self._point(settings)
                except InputError as error:
                    problem = error.problem if isinstance(error, Contradiction) else str(error)
                    self._tried[key] = Tried(reason=f"there is no run with {told(settings)}: {problem}")
        for key, trial in zip(points, self._bench.run(points.values(), title), strict=True):
            how = "was refused" if trial.status == REFUSED else trial.status
            reason = f"the run with {told(points[key].settings)} {how}: {trial.reason}"
            self._tried[key] = Tried(headlines(trial.run), trial.cpu_s) if trial.is_done else Tried(reason=reason)

    def _point(self, settings: Settings) -> Point:
        """Units are called directly: that gives the same bits, and FMUs on meshes so fine are larger than is read."""
        point = self._variants.point(settings)
        run = point.scenario.run.model_copy(update={"participants": "native"})
        return Point(point.scenario.model_copy(update={"run": run}), point.base, point.settings)

    def __getitem__(self, settings: Settings) -> Tried:
        """What came of a run that was asked for; KeyError for others."""
        return self._tried[_key(settings)]

    def __contains__(self, settings: Settings) -> bool:
        return _key(settings) in self._tried


def _key(settings: Settings) -> str:
    return json.dumps(dict(settings), sort_keys=True)
