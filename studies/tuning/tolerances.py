"""What a person allows: the largest error of each measure that the tuned scenario may have."""

from collections.abc import Iterable, Mapping
from math import isfinite

from ...orchestrator.errors import InputError, did_you_mean
from ...orchestrator.quoting import shortened
from ...orchestrator.results.comparison import Measure, measures
from ...orchestrator.results.stored_run import StoredRun

#: Characters of an argument that a message repeats.
_LONGEST = 100


def parsed_tolerances(texts: Iterable[str]) -> dict[str, float]:
    """Limits by measure from `measure=limit`; InputError for what is none, for none at all, and for one given twice."""
    limits: dict[str, float] = {}
    for text in texts:
        name, separator, number = (part.strip() for part in text.partition("="))
        told = f"--tolerance {shortened(text, _LONGEST)}"
        if not separator or not name:
            raise InputError(f"{told}: write it as measure=limit, e.g. --tolerance activation_ms=1")
        try:
            limit = float(number)
        except ValueError:
            raise InputError(
                f"{told}: '{shortened(number)}' is not a number; its unit of measure is that of the measure"
            ) from None
        if not isfinite(limit) or limit <= 0.0:
            raise InputError(f"{told}: a limit on an error is a finite number above 0")
        if name in limits:
            raise InputError(f"{told}: {shortened(name)} has a tolerance already; keep one of the two")
        limits[name] = limit
    if not limits:
        raise InputError("--tolerance is missing: say which error is allowed, e.g. --tolerance activation_ms=1")
    return limits


def chosen_measures(limits: Mapping[str, float], run: StoredRun, across_meshes: bool) -> list[Measure]:
    """The measures of the tolerances, as `run`, a run of the scenario, has them.

    InputError for one that it does not have, and for a field `across_meshes`, whose places are others on each mesh.
    """
    known = measures(run)
    comparable = {name: measure for name, measure in known.items() if not (across_meshes and name in run.moving)}
    for name in limits:
        if name not in known:
            raise InputError(
                f"--tolerance {shortened(name, _LONGEST)}: the scenario has no such measure, or it never changes"
                f"{did_you_mean(name, comparable)}"
            )
        if name not in comparable:
            raise InputError(
                f"--tolerance {name}: a field has other places on every mesh, so that with --mesh only probes and "
                f"curves can be compared; choose among {', '.join(comparable) or 'none'}, or leave --mesh out"
            )
    return [known[name] for name in limits]
