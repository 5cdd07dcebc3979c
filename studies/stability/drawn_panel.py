"""A panel of a map, drawn on axes."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.patches import Rectangle
from matplotlib.patheffects import Normal, withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

from ..pictures.lettering import plain
from ..pictures.ticks import set_ticks
from .look import LOOKS
from .placed_axis import number_text
from .placed_panel import PlacedPanel
from .tick_labels import TickLabels

_INK = "black"

#: Points: the predicted boundary, the sign of a run between, the marker of a crossing, and the light rim around each.
_LIMIT, _STRIP, _MARKER, _RIM = 2.6, 2.6, 5.0, 2.0

#: Ticks of a linear axis whose own values have no room.
_FEW = 5


def draw_panel(axis: Axes, placed: PlacedPanel, across: TickLabels, up: TickLabels) -> None:
    """Draw one panel: boxes, the runs between them, the predicted boundary over both, and what was measured."""
    x, y = placed.x, placed.y
    if x.is_logarithmic:
        axis.set_xscale("log")
    if y.is_logarithmic:
        axis.set_yscale("log")
    axis.set(xlim=(x.edges[0], x.edges[-1]), ylim=(y.edges[0], y.edges[-1]))
    for box, cell in placed.boxes.items():
        left, right, low, high = placed.corners(box)
        look = LOOKS[cell.kind]
        axis.add_patch(Rectangle((left, low), right - left, high - low, label=cell.kind, zorder=1.0, **look.area))
    for edge in x.edges[1:-1]:
        axis.axvline(edge, color="white", linewidth=_between(len(x.places)), zorder=1.5)
    for edge in y.edges[1:-1]:
        axis.axhline(edge, color="white", linewidth=_between(len(y.places)), zorder=1.5)
    for mark in placed.marks:
        draw_mark(axis, mark.left, mark.right, mark.y, mark.cell.kind)
    for piece in placed.limit:
        draw_limit(axis, *piece.T.tolist())
    for each in placed.crossings:
        crossing = each.crossing
        draw_crossing(axis, each.x, crossing.measured, crossing.low, crossing.high)
    _put_labels(axis.xaxis, across)
    _put_labels(axis.yaxis, up)
    axis.tick_params(labelsize=across.size, length=3.0)


def draw_mark(axis: Axes, left: float, right: float, y: float, kind: str) -> None:
    """Draw the sign of a run between the grid's values: a strip in the colour of its class."""
    axis.plot(
        [left, right],
        [y, y],
        color=LOOKS[kind].color,
        linewidth=_STRIP,
        solid_capstyle="butt",
        label="between",
        zorder=2.0,
        path_effects=[withStroke(linewidth=_STRIP + 1.0, foreground="0.15")],
    )


def draw_limit(axis: Axes, x: Sequence[float], y: Sequence[float]) -> None:
    """Draw a piece of the predicted boundary: thick and dark, with a light rim that parts it from dark boxes."""
    axis.plot(
        x,
        y,
        color=_INK,
        linewidth=_LIMIT,
        solid_capstyle="butt",
        label="theory",
        zorder=3.0,
        path_effects=[withStroke(linewidth=_LIMIT + _RIM, foreground="white")],
    )


def draw_crossing(axis: Axes, x: float, middle: float, low: float, high: float) -> None:
    """Draw where a boundary was measured, and between which two runs."""
    drawn = axis.errorbar(
        x,
        middle,
        yerr=[[middle - low], [high - middle]],
        marker="D",
        markersize=_MARKER,
        markerfacecolor="white",
        markeredgecolor=_INK,
        markeredgewidth=1.1,
        ecolor=_INK,
        elinewidth=1.1,
        capsize=3.0,
        capthick=1.1,
        label="measured",
        zorder=4.0,
    )
    rim = [withStroke(linewidth=1.1 + _RIM, foreground="white"), Normal()]
    for line in (*drawn.lines[1], *drawn.lines[2]):
        line.set_path_effects(rim)


# --- inside -----------------------------------------------------------------------------------------------------------


def _between(boxes: int) -> float:
    """Points of the lines between so many boxes in a row; many thick ones would be all that is seen."""
    return min(1.0, 12.0 / boxes)


def _put_labels(axis: Axis, labels: TickLabels) -> None:
    if labels.lines is not None:
        axis.set_major_locator(FixedLocator(labels.axis.places))
        axis.set_minor_locator(NullLocator())
        axis.set_ticklabels(["\n".join(map(plain, lines)) for lines in labels.lines], rotation=labels.rotation)
    elif labels.axis.is_logarithmic:
        set_ticks(axis, labels.axis.edges[0], labels.axis.edges[-1])
    else:
        first, last = labels.axis.edges[0], labels.axis.edges[-1]
        places = MaxNLocator(_FEW).tick_values(first, last)
        axis.set_major_locator(FixedLocator([place for place in places if first <= place <= last]))
        axis.set_major_formatter(FuncFormatter(lambda value, _: number_text(value)))
