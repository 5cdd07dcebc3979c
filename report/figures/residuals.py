"""How the residuals fell from sweep to sweep in steps that were iterated, those of a step that failed included."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.names import ITERATIONS
from ...orchestrator.results.stored_run import StoredRun
from .plot_axes import color, label, note, panels

_RESIDUAL = "residual_"

#: Steps whose lines are drawn at most; more would be one grey area that takes long to draw.
_MOST = 400


def residuals(run: StoredRun) -> Figure | None:
    """A panel per field with a line per step over its sweeps; None for a run that iterated nothing."""
    columns = run.numbers(ITERATIONS)
    fields = [name for name in columns if name.startswith(_RESIDUAL)]
    time, sweep = columns.get("time_ms"), columns.get("iteration")
    if time is None or sweep is None or not len(time) or not fields:
        return None
    begins = np.flatnonzero(sweep == 1)
    steps = np.split(np.arange(len(time)), begins[1:])
    failed = _failed(run, float(time[-1]))
    figure, axes = panels(len(fields), 3.4)
    for axis, field in zip(axes, fields, strict=True):
        _draw(axis, columns[field], sweep, steps, failed)
        label(axis, vertical=f"residual of\n{field.removeprefix(_RESIDUAL)}")
    accepted = len(steps) - failed
    told = f"{accepted} step{'' if accepted == 1 else 's'}, a line for each" if accepted else ""
    if failed:
        told = "; ".join(filter(None, (told, f"dashed: the step to {time[-1]:g} ms, which failed")))
    note(axes[0], told)
    axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    label(axes[-1], "sweep of the step")
    return figure


def _draw(axis: Axes, residual: Values, sweep: Values, steps: list[np.ndarray], failed: bool) -> None:
    accepted = steps[:-1] if failed else steps
    for rows in accepted[:: max(len(accepted) // _MOST, 1)]:
        axis.semilogy(sweep[rows], residual[rows], "-", marker=".", color=color(0), linewidth=0.8, alpha=0.35)
    if failed:
        rows = steps[-1]
        axis.semilogy(sweep[rows], residual[rows], "--", marker="o", color=color(1), linewidth=2.0, zorder=5)
    if not np.any(residual[np.isfinite(residual)] > 0.0):
        axis.set_yscale("linear")


def _failed(run: StoredRun, last_ms: float) -> bool:
    """Whether the last sweeps are those of a step that was not accepted."""
    accepted = run.columns.get("time_ms", np.empty(0))
    return run.summary.get("status") == "failed" and (not len(accepted) or last_ms > accepted[-1] + 1e-9)
