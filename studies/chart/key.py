"""What the signs of a figure mean: those of all panels, and the lines of each measure with their orders of accuracy."""

from collections.abc import Sequence
from math import isinf, isnan

from matplotlib.axes import Axes

from ..pictures.legend import (
    SAMPLE_IN,
    SIZE,
    SMALL,
    STROKE_IN,
    Entry,
    Sample,
    area_sample,
    in_rows,
    line_sample,
    marker_sample,
    word_sample,
)
from ..pictures.lettering import broken, name_lines
from .caption import limit_text, uncertainty_text
from .chart import Chart
from .drawn_panel import BAND, CROSS, FRONT, INFINITE, LIMIT, ZERO, line_style, marker, without_cost
from .labels import SIZE as LABEL_SIZE
from .panel import Panel, is_sweep
from .style import Style, style_of

#: Of no line in particular.
_ANY = Style("0.3", "o", "circle", ())


def line_entries(chart: Chart, panel: Panel, width_in: float) -> list[Entry]:
    """The lines of a chart with their orders for this panel's measure, the reference's uncertainty, the tolerance."""
    room = width_in - SAMPLE_IN - 0.1
    entries = []
    same = _same_varied(chart)
    for number, line in enumerate(chart.lines):
        small = []
        order = line.orders.get(panel.measure.name)
        if order is not None:
            small.append(f"order {order:z.1f}")
        if not is_sweep(line) and len(line.rows) > 1:
            small += broken("line through its best points", SMALL, room)
        if same is None and line.varied:
            small += broken(f"at the points: {', '.join(line.varied)}", SMALL, room)
        entries.append(Entry(_sample_of(number), name_lines(line.name, SIZE, room), small))
    if panel.uncertainty is not None:
        text = f"uncertainty of the reference: {uncertainty_text(panel)}"
        entries.append(Entry(area_sample(0.1, **BAND), broken(text, SIZE, room)))
    if panel.limit is not None:
        entries.append(Entry(line_sample(**LIMIT), broken(limit_text(panel), SIZE, room)))
    return entries


def sign_entries(chart: Chart, panels: Sequence[Panel], longest_in: float) -> list[list[Entry]]:
    """Rows of entries for the signs that occur in any panel."""
    spots = [spot for panel in panels for line in panel.spots for spot in line]
    same = _same_varied(chart)
    found: list[tuple[Sample, str]] = [
        (marker_sample(**marker(_ANY, True)), "on the front (no point is cheaper and as accurate)"),
        (marker_sample(**marker(_ANY, False)), "dominated"),
        (line_sample(**FRONT), "front"),
    ]
    if any(panel.view.extent(spot.row) for panel in panels for line in panel.spots for spot in line):
        found.append((_bar_sample, "range of repeated runs"))
    if any(without_cost(panel) for panel in panels) or any(isnan(spot.error) for spot in spots):
        found.append((marker_sample(**CROSS), "no result, numbers: see below"))
    if any(isinf(spot.error) for spot in spots):
        found.append((word_sample(INFINITE, LABEL_SIZE), "infinite error"))
    if any(spot.error == 0.0 for spot in spots):
        found.append((word_sample(ZERO, LABEL_SIZE), "error of exactly zero"))
    if same:
        found.append((word_sample("0.5", LABEL_SIZE), f"at the points: {', '.join(same)}"))
    return in_rows(found, longest_in)


# --- inside -----------------------------------------------------------------------------------------------------------


def _same_varied(chart: Chart) -> list[str] | None:
    """The keys that vary, if they are the same in all lines where any do."""
    found = {tuple(line.varied) for line in chart.lines if line.varied}
    return list(found.pop()) if len(found) == 1 else None if found else []


def _sample_of(number: int) -> Sample:
    style = style_of(number)

    def draw(axis: Axes, left: float, middle: float) -> None:
        line_sample(**line_style(style))(axis, left, middle)
        marker_sample(**marker(style, True))(axis, left, middle)

    return draw


def _bar_sample(axis: Axes, left: float, middle: float) -> None:
    axis.errorbar(left + 0.5 * STROKE_IN, middle, xerr=0.12, fmt="none", ecolor="0.3", elinewidth=1.0, capsize=2.5)
