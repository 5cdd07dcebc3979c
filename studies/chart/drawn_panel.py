"""A panel of a chart, drawn on axes."""

from collections.abc import Sequence
from math import isfinite, isinf, isnan
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..pictures.ticks import set_ticks
from ..point import value_text
from .chart import ChartLine
from .footnotes import Footnotes
from .labels import Label, put_labels
from .panel import Panel, Spot, path
from .style import Style, style_of

#: The front and what is shaded up to the uncertainty of the reference.
FRONT: dict[str, Any] = {"color": "0.83", "linewidth": 4.0, "solid_capstyle": "butt", "solid_joinstyle": "miter"}
BAND: dict[str, Any] = {"facecolor": "0.95", "edgecolor": "0.82", "hatch": "///", "linewidth": 0.0}

#: The tolerance.
LIMIT: dict[str, Any] = {"color": "black", "linewidth": 1.0, "linestyle": (0, (5, 3))}

#: A point without a result, and the arrows of errors that have no place on the axis.
CROSS: dict[str, Any] = {
    "marker": "x",
    "color": "black",
    "markersize": 5.0,
    "markeredgewidth": 1.3,
    "linestyle": "none",
}
INFINITE, ZERO = "↑", "↓ 0"

_SMALL = 8.0

#: Inches that points without a result are apart, and what is written before them.
STRIP_STEP_IN, STRIP_ROW_IN, STRIP_WORDS, STRIP_WORDS_IN = 0.25, 0.19, "no result:", 0.68

#: Opacity of dominated points: they are to be seen, but after those on the front.
_FADED = 0.6

#: Letters of a label at a point.
_LONGEST = 16


def marker(style: Style, is_on_front: bool) -> dict[str, Any]:
    """How a point is marked: full on the front, hollow and faded where it is dominated."""
    return {
        "marker": style.marker,
        "markersize": 9.0 if style.marker == "*" else 6.5,
        "markeredgewidth": 1.2,
        "markeredgecolor": style.color,
        "markerfacecolor": style.color if is_on_front else "white",
        "alpha": 1.0 if is_on_front else _FADED,
        "linestyle": "none",
    }


def line_style(style: Style) -> dict[str, Any]:
    """How the points of a line are connected."""
    return {
        "color": style.color,
        "linewidth": 1.5,
        "linestyle": (0, style.dashes) if style.dashes else "-",
        "marker": "none",
    }


def draw_panel(axis: Axes, panel: Panel, lines: Sequence[ChartLine], notes: Footnotes) -> None:
    """Draw one panel; points without a result stand in rows above the axes."""
    axis.set(xscale="log", yscale="log", xlim=panel.costs, ylim=panel.errors)
    set_ticks(axis.xaxis, *panel.costs)
    set_ticks(axis.yaxis, *panel.errors)
    axis.grid(color="0.9", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.tick_params(labelsize=9.0)
    axis.set_xlabel(panel.view.label, fontsize=10.0)
    if not panel.has_scale:
        axis.set_yticks([])
        axis.set_yticks([], minor=True)
    _draw_uncertainty(axis, panel)
    _draw_limit(axis, panel)
    across, up = panel.stairs()
    axis.plot(across, up, label="front", zorder=1.0, **FRONT)
    obstacles = []
    for number, line in enumerate(lines):
        for piece in path(line, panel.spots[number]):
            corners = np.array([panel.place(spot) for spot in piece])
            axis.plot(*corners.T, zorder=2.0, **line_style(style_of(number)))
            obstacles.append(corners)
    labels, places = [], []
    for number, spots in enumerate(panel.spots):
        for spot in spots:
            if not isnan(spot.cost):
                places.append(panel.place(spot))
                obstacles += _draw_spot(axis, panel, spot, style_of(number), notes)
                labels.append(Label(_label(spot), places[-1], style_of(number).color))
    put_labels(axis, [label for label in labels if label.text], places, obstacles)
    _draw_strip(axis, panel, notes)


def without_cost(panel: Panel) -> list[tuple[int, Spot]]:
    """The points without a result and the numbers of their lines."""
    return [(number, spot) for number, spots in enumerate(panel.spots) for spot in spots if isnan(spot.cost)]


def strip_rows(count: int, width_in: float) -> int:
    """Rows that so many points without a result need above a panel of this width."""
    return -(-count // _columns(width_in))


def has_arrows(panel: Panel) -> bool:
    """Whether something is written above the upper edge."""
    return any(not isnan(spot.cost) and not isfinite(spot.error) for spots in panel.spots for spot in spots)


# --- inside -----------------------------------------------------------------------------------------------------------


def _draw_uncertainty(axis: Axes, panel: Panel) -> None:
    if panel.uncertainty is not None and panel.uncertainty > panel.errors[0]:
        top = min(panel.uncertainty, panel.errors[1])
        axis.axhspan(panel.errors[0], top, label="uncertainty of the reference", zorder=0.5, **BAND)


def _draw_limit(axis: Axes, panel: Panel) -> None:
    if panel.limit is not None and panel.errors[0] < panel.limit < panel.errors[1]:
        axis.axhline(panel.limit, label="tolerance", zorder=0.6, **LIMIT)


def _draw_spot(
    axis: Axes, panel: Panel, spot: Spot, style: Style, notes: Footnotes
) -> list["np.typing.NDArray[np.float64]"]:
    """Draw a point with a cost; where its bar reaches from and to."""
    x, y = panel.place(spot)
    bars = []
    extent = panel.view.extent(spot.row)
    if extent is not None:
        axis.errorbar(
            x,
            y,
            xerr=[[x - extent[0]], [extent[1] - x]],
            ecolor=style.color,
            elinewidth=1.0,
            capsize=2.5,
            fmt="none",
            zorder=2.5,
        )
        bars.append(np.array([(extent[0], y), (extent[1], y)]))
    # A white disc keeps lines and the front from showing through a faded marker.
    axis.plot(x, y, **(marker(style, False) | {"markeredgecolor": "white", "alpha": 1.0}), clip_on=False, zorder=3.0)
    axis.plot(x, y, **marker(style, spot.is_on_front), clip_on=False, zorder=3.5 if spot.is_on_front else 3.2)
    number = notes.number(spot.row)
    if isnan(spot.error):
        axis.plot(x, y, **CROSS, clip_on=False, zorder=3.6)
    if isnan(spot.error) or isinf(spot.error):
        text = (INFINITE if isinf(spot.error) else "") + ("" if number is None else f" {number}")
        _write(axis, text.strip(), (x, y), (0.0, 5.0), "bottom")
    elif spot.error == 0.0:
        _write(axis, ZERO, (x, y), (0.0, 5.0), "bottom")
    return bars


def _write(axis: Axes, text: str, place: tuple[float, float], away: tuple[float, float], vertical: str) -> None:
    axis.annotate(
        text, place, away, textcoords="offset points", ha="center", va=vertical, fontsize=_SMALL, annotation_clip=False
    )


def _label(spot: Spot) -> str:
    if not isfinite(spot.error) or spot.error == 0.0:
        return ""
    text = ", ".join(value_text(value) for value in spot.row.settings.values())
    return text if len(text) <= _LONGEST else ""


def _columns(width_in: float) -> int:
    return max(int((width_in - STRIP_WORDS_IN) / STRIP_STEP_IN), 1)


def _draw_strip(axis: Axes, panel: Panel, notes: Footnotes) -> None:
    window = axis.get_window_extent()
    width, height = window.width / axis.figure.dpi, window.height / axis.figure.dpi
    spots = without_cost(panel)
    if not spots:
        return
    columns = _columns(width)
    base = 1.0 + (STRIP_ROW_IN * (0.6 + has_arrows(panel))) / height
    rows = strip_rows(len(spots), width)
    top = base + (rows - 1) * STRIP_ROW_IN / height
    axis.text(0.0, top, STRIP_WORDS, transform=axis.transAxes, fontsize=_SMALL, va="center")
    for place, (number, spot) in enumerate(spots):
        x = (STRIP_WORDS_IN + (place % columns + 0.35) * STRIP_STEP_IN) / width
        y = top - place // columns * STRIP_ROW_IN / height
        axis.plot(x, y, transform=axis.transAxes, clip_on=False, **marker(style_of(number), False))
        axis.plot(x, y, transform=axis.transAxes, clip_on=False, **CROSS)
        note = notes.number(spot.row)
        if note is not None:
            x += 0.07 / width
            axis.text(x, y, str(note), transform=axis.transAxes, fontsize=_SMALL - 1.0, va="center")
