"""How the coupling went, as panels over time: sweeps, residuals, steps, contraction, growth and time; and in words."""

from collections.abc import Mapping

import numpy as np

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.names import COUPLING, ITERATIONS
from ...orchestrator.results.stored_run import StoredRun
from .panels import MOST_CURVES, Curve, Panel


def coupling_curves(run: StoredRun) -> list[Panel]:
    """All that there is something to see of."""
    log, sweeps = run.numbers(COUPLING), run.numbers(ITERATIONS)
    time = log.get("time_ms")
    found: list[Panel] = []
    if _varies(log, "step_ms"):
        found.append(Panel("communication step size (ms)", _curves(log, "step_ms"), steps=True))
    if _varies(log, "iterations"):
        title = "iterations of each step (count of sweeps)"
        found.append(Panel(title, _curves(log, "iterations"), steps=True, whole_numbers=True))
    residuals = _residuals(sweeps)
    if residuals:
        found.append(
            Panel(
                "residual of every sweep (Euclidean norm, in the field's unit)",
                residuals,
                is_logarithmic=True,
                mode="lines+markers",
                has_gaps=True,
            )
        )
    if time is None or not len(time):
        return found
    contraction = _curves(log, "contraction_rate")
    if contraction:
        title = "contraction rate of the residual (dimensionless; below 1 the iteration converges)"
        found.append(Panel(title, contraction, is_logarithmic=True, mode="lines+markers"))
    growth = [curve for curve in _starting(log, "growth_") if np.nanmax(curve.values) > 0.0]
    if growth:
        title = "growth of alternating differences (factor per step; above 1 they grow)"
        found.append(Panel(title, growth, mode="lines+markers"))
    rejected = log.get("rejected")
    if rejected is not None and np.any(rejected > 0.0):
        found.append(Panel("rejected attempts at a step (count)", _curves(log, "rejected"), whole_numbers=True))
    error = _curves(log, "error")
    if error:
        found.append(Panel("estimated error over the tolerance (dimensionless)", error, is_logarithmic=True))
    seconds = _starting(log, "seconds_")
    if seconds:
        found.append(Panel("wall-clock time of each step (s)", seconds, is_logarithmic=True))
    return found


def constants(run: StoredRun) -> list[str]:
    """Sentences on what is the same in every step, and therefore no curve."""
    log = run.numbers(COUPLING)
    if not len(log.get("time_ms", ())):
        return []
    found = []
    if not _varies(log, "step_ms") and "step_ms" in log:
        found.append(f"Every communication step is {log['step_ms'][0]:g} ms long.")
    if not _varies(log, "iterations") and "iterations" in log:
        count = int(log["iterations"][0])
        found.append("Every step takes one sweep." if count == 1 else f"Every step takes {count} sweeps.")
    if "rejected" in log and not np.any(log["rejected"] > 0.0):
        found.append("No attempt at a step was rejected.")
    return found


def _varies(log: Mapping[str, Values], name: str) -> bool:
    """Whether a column has different values, apart from rounding."""
    values = log.get(name)
    return values is not None and len(values) > 0 and bool(np.ptp(values) > 1e-9 * np.abs(values).max())


def _curves(log: Mapping[str, Values], name: str) -> list[Curve]:
    values = log.get(name)
    if values is None or not np.isfinite(values).any():
        return []
    return [Curve(name.replace("_", " "), log["time_ms"], values)]


def _starting(log: Mapping[str, Values], start: str) -> list[Curve]:
    names = [name for name in log if name.startswith(start) and np.isfinite(log[name]).any()]
    return [Curve(name.removeprefix(start), log["time_ms"], log[name]) for name in names[:MOST_CURVES]]


def _residuals(sweeps: Mapping[str, Values]) -> list[Curve]:
    """The residuals over the sweeps, which are spread over the step that they belong to."""
    ends, number = sweeps.get("time_ms"), sweeps.get("iteration")
    if ends is None or number is None or not len(ends):
        return []
    steps, first, count = np.unique(ends, return_index=True, return_counts=True)
    starts = np.concatenate([[0.0], steps[:-1]])
    which = np.searchsorted(steps, ends)
    place = starts[which] + (steps - starts)[which] * number / count[which]
    found = []
    for name, values in sweeps.items():
        if name.startswith("residual_") and np.isfinite(values).any():
            # Steps are no continuation of one another: a gap stands between them.
            values = np.insert(values, first, np.nan)
            found.append(Curve(name.removeprefix("residual_"), np.insert(place, first, starts), values))
    return found[:MOST_CURVES]
