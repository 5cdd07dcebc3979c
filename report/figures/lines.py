"""Lines over the time of a run: potential at the probes, volumes of the cavities."""

import re
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from ...studies.pictures.colors import COLORS

_STYLES = ("-", "--", ":", "-.")

_PROBE = re.compile(r"(?:(?P<unit>.+)\.)?potential_(?P<probe>.+)_mV")
_VOLUME = "_volume_ml"


def probe_potential(run: StoredRun) -> Figure | None:
    """A line per probe; None for a run without probed potentials."""
    lines = {}
    for name, values in run.columns.items():
        if column := _PROBE.fullmatch(name):
            unit, probe = column.group("unit", "probe")
            lines[f"{probe} ({unit})" if unit else probe] = values
    return _over_time(run, lines, "transmembrane potential (mV)", "probe")


def cavity_volumes(run: StoredRun) -> Figure | None:
    """A line per cavity; None for a run that records no volume."""
    lines = {
        name.removesuffix(_VOLUME).upper().replace("_", " "): values
        for name, values in run.columns.items()
        # A scene without that cavity has no volume of it.
        if name.endswith(_VOLUME) and np.any(values > 0.0)
    }
    figure = _over_time(run, lines, "cavity volume (ml)", "cavity")
    if figure is not None:
        # Heights then compare as the volumes do.
        figure.axes[0].set_ylim(bottom=0.0)
    return figure


def _over_time(run: StoredRun, lines: Mapping[str, Values], label: str, legend: str) -> Figure | None:
    """A line per entry of `lines`, shape (rows,) each, under its name; None if there is nothing to draw."""
    time = run.columns.get("time_ms")
    if time is None or not len(time) or not lines:
        return None
    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    axis = figure.subplots()
    for number, (name, values) in enumerate(lines.items()):
        color = COLORS[number % len(COLORS)]
        style = _STYLES[number // len(COLORS) % len(_STYLES)]
        # A single row makes no line; a dot shows that it is there.
        # Units that step less often leave gaps.
        known = np.isfinite(values)
        axis.plot(
            time[known],
            values[known],
            style,
            color=color,
            linewidth=2.0,
            marker="o" if len(time) == 1 else None,
            label=name,
        )
    if len(time) > 1:
        axis.set_xlim(time[0], time[-1])
    axis.set_xlabel("time (ms)", fontsize=12)
    axis.set_ylabel(label, fontsize=12)
    axis.tick_params(labelsize=11)
    axis.grid(color="0.9")
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(
        title=legend, fontsize=11, title_fontsize=11, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0)
    )
    return figure
