"""How accurate the runs of a map are: their errors against references, and which of them exceed a tolerance."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isnan

from ...orchestrator.errors import InputError, did_you_mean
from ...orchestrator.results.comparison import Measure, measures
from ...orchestrator.results.stored_run import StoredRun
from ..trial import Trial


@dataclass(frozen=True)
class Judgement:
    """Errors by measure; what is `exceeded`, in words, and why something could not be judged; else empty."""

    errors: Mapping[str, float] = field(default_factory=dict)
    exceeded: str = ""
    unjudged: str = ""


class Accuracy:
    """Judges runs by the errors `allowed`, by measure; those of `measured` are told besides.

    `references` are all that there are of a study; they know which measures there are. InputError, which begins with
    the `origin`, for a measure that none of them has.
    """

    def __init__(
        self,
        allowed: Mapping[str, float],
        measured: Iterable[str],
        references: Iterable[StoredRun],
        origin: str,
    ) -> None:
        self._allowed = dict(allowed)
        self._names = list(dict.fromkeys([*allowed, *measured]))
        self._known: dict[str, Measure] = {}
        for reference in references:
            if any(name not in self._known for name in self._names):
                # One that stays at rest tells of a run that does not.
                self._known |= measures(reference, still=True)
        # Without any reference nothing is judged, and each run says why.
        for name in self._names if self._known else ():
            if name not in self._known:
                key = "tolerances" if name in self._allowed else "measures"
                raise InputError(
                    f"{origin}: {key}: the scenario has no '{name}'"
                    f"{did_you_mean(name, self._known)}; name a quantity that the scenario records"
                )

    def judged(self, trial: Trial, reference: StoredRun | str | None) -> Judgement:
        """How accurate a run is that is done, compared with its `reference`; a text says why there is none."""
        if not self._names or not trial.is_done or reference is None:
            return Judgement()
        if isinstance(reference, str):
            return Judgement(unjudged=f"not judged for accuracy: {reference}")
        errors: dict[str, float] = {}
        exceeded, unjudged = [], []
        for name in self._names:
            measure = self._known[name]
            difference = measure.between(trial.run, reference)
            if isnan(difference.value):
                unjudged.append(difference.why)
                continue
            errors[name] = difference.value
            allowed = self._allowed.get(name)
            if allowed is not None and difference.value > allowed:
                exceeded.append(difference.why or _told(measure, difference.value, allowed))
        why = f"not judged for accuracy: {'; '.join(dict.fromkeys(unjudged))}" if unjudged else ""
        return Judgement(errors, "; ".join(exceeded), why)


def _told(measure: Measure, error: float, allowed: float) -> str:
    return f"the error in {measure.name} is {f'{error:.3g} {measure.unit}'.rstrip()}, the tolerance {allowed:g}"
