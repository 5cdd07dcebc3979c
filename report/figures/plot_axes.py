"""Axes of plots over time or space: one look for all, legible on a phone and in black and white."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from ...orchestrator.participants.participant import Values
from ...studies.pictures.colors import COLORS

#: Width of a plot on the page, and height of one of its panels, in inches.
WIDTH, PANEL_HEIGHT = 6.4, 3.4

#: Lines differ in their dashes as well as in their colours, so that a print in black and white tells them apart.
_DASHES = ("-", "--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (1, 3)))

_FONT = 11

#: How far the names of curves stand below a panel, in points.
_BELOW_LABELS, _BELOW_TICKS = 42.0, 12.0


def panels(rows: int, height: float = PANEL_HEIGHT) -> tuple[Figure, Sequence[Axes]]:
    """A figure of so many panels above one another, which share their horizontal axis."""
    figure = Figure(figsize=(WIDTH, height * rows + 0.5), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, 1, sharex=True)).tolist()
    for axis in axes:
        styled(axis)
    return figure, axes


def styled(axis: Axes) -> None:
    """Give axes the look of all others."""
    axis.tick_params(labelsize=_FONT - 1)
    axis.grid(color="0.9")
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def label(axis: Axes, horizontal: str | None = None, vertical: str | None = None) -> None:
    """What the axes show, with its unit of measure."""
    if horizontal is not None:
        axis.set_xlabel(horizontal, fontsize=_FONT)
    if vertical is not None:
        axis.set_ylabel(vertical, fontsize=_FONT)


def curve(axis: Axes, number: int, time: Values, values: Values, name: str | None = None) -> None:
    """The curve of that number among those of its panel, shape (rows,); units that step less often leave gaps.

    A single row makes no line; a dot shows that it is there.
    """
    known = np.isfinite(values)
    axis.plot(
        time[known],
        values[known],
        color=color(number),
        linestyle=_DASHES[number % len(_DASHES)],
        linewidth=2.0,
        marker="o" if known.sum() == 1 else None,
        label=name,
    )


def color(number: int) -> str:
    """The colour of the curve of that number."""
    return COLORS[number % len(COLORS)]


def span(axis: Axes, time: Values) -> None:
    """Let the axis of times reach from the first to the last."""
    if len(time) > 1:
        axis.set_xlim(time[0], time[-1])


def key(axis: Axes, columns: int = 2) -> None:
    """The names of the curves, below the panel, where they take no width from it."""
    count = len(axis.get_legend_handles_labels()[1])
    figure, place = axis.get_figure(), axis.get_subplotspec()
    if not count or figure is None:
        return
    # Below the labels of the horizontal axis, which only the lowest panel has.
    below = _BELOW_LABELS if place is None or place.is_last_row() else _BELOW_TICKS
    axis.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=axis.transAxes + ScaledTranslation(0.0, -below / 72.0, figure.dpi_scale_trans),
        ncols=min(columns, count),
        fontsize=_FONT - 1,
        frameon=False,
        handlelength=2.8,
        borderaxespad=0.0,
    )


def note(axis: Axes, text: str) -> None:
    """A sentence above the panel."""
    axis.set_title(text, fontsize=_FONT, loc="left")
