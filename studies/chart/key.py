"""What the signs of a figure mean: those of all panels, and the lines of each measure with their orders of accuracy."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isinf, isnan
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from .caption import limit_text, uncertainty_text
from .chart import Chart
from .drawn_panel import BAND, CROSS, FRONT, INFINITE, LIMIT, ZERO, line_style, marker, without_cost
from .labels import SIZE as LABEL_SIZE
from .lettering import broken, name_lines, plain, width_in
from .panel import Panel, is_sweep
from .style import Style, style_of

_SIZE, _SMALL, _LINE_IN = 9.5, 8.5, 0.165

#: Inches of a sample's line, of a sample with the space beside it, and between entries.
_STROKE_IN, _SAMPLE_IN, _GAP_IN = 0.32, 0.38, 0.22

#: Of no line in particular.
_ANY = Style("0.3", "o", "circle", ())

Sample = Callable[[Axes, float, float], None]


@dataclass(frozen=True)
class Entry:
    """Lines of text beside a sample, which is drawn around the middle of the first line; small lines follow."""

    sample: Sample
    text: list[str]
    small: list[str]

    @property
    def height_in(self) -> float:
        """With the space below."""
        return _LINE_IN * (len(self.text) + 0.95 * len(self.small)) + 0.07


def line_entries(chart: Chart, panel: Panel, width_in: float) -> list[Entry]:
    """The lines of a chart with their orders for this panel's measure, the reference's uncertainty, the tolerance."""
    room = width_in - _SAMPLE_IN - 0.1
    entries = []
    same = _same_varied(chart)
    for number, line in enumerate(chart.lines):
        small = []
        order = line.orders.get(panel.measure.name)
        if order is not None:
            small.append(f"order {order:z.1f}")
        if not is_sweep(line) and len(line.rows) > 1:
            small += broken("line through its best points", _SMALL, room)
        if same is None and line.varied:
            small += broken(f"at the points: {', '.join(line.varied)}", _SMALL, room)
        entries.append(Entry(_line_sample(number), name_lines(line.name, _SIZE, room), small))
    if panel.uncertainty is not None:
        text = f"uncertainty of the reference: {uncertainty_text(panel)}"
        entries.append(Entry(_band_sample, broken(text, _SIZE, room), []))
    if panel.limit is not None:
        entries.append(Entry(_stroke(**LIMIT), broken(limit_text(panel), _SIZE, room), []))
    return entries


def sign_entries(chart: Chart, panels: Sequence[Panel], longest_in: float) -> list[list[Entry]]:
    """Rows of entries for the signs that occur in any panel."""
    spots = [spot for panel in panels for line in panel.spots for spot in line]
    same = _same_varied(chart)
    found: list[tuple[Sample, str]] = [
        (_sample(**marker(_ANY, True)), "on the front (no point is cheaper and as accurate)"),
        (_sample(**marker(_ANY, False)), "dominated"),
        (_stroke(**FRONT), "front"),
    ]
    if any(panel.view.extent(spot.row) for panel in panels for line in panel.spots for spot in line):
        found.append((_bar_sample, "range of repeated runs"))
    if any(without_cost(panel) for panel in panels) or any(isnan(spot.error) for spot in spots):
        found.append((_sample(**CROSS), "no result, numbers: see below"))
    if any(isinf(spot.error) for spot in spots):
        found.append((_words(INFINITE), "infinite error"))
    if any(spot.error == 0.0 for spot in spots):
        found.append((_words(ZERO), "error of exactly zero"))
    if same:
        found.append((_words("0.5"), f"at the points: {', '.join(same)}"))
    rows: list[list[Entry]] = [[]]
    used = 0.0
    for sample, text in found:
        lines = broken(text, _SIZE, longest_in - _SAMPLE_IN)
        width = _SAMPLE_IN + max(width_in(line, _SIZE) for line in lines) + _GAP_IN
        if rows[-1] and used + width > longest_in:
            rows.append([])
            used = 0.0
        rows[-1].append(Entry(sample, lines, []))
        used += width
    return rows


def draw_rows(axis: Axes, rows: Sequence[Sequence[Entry]], top_in: float) -> None:
    """Draw rows of entries on axes whose unit is an inch, from the upper left."""
    for row in rows:
        left = 0.0
        for entry in row:
            _draw(axis, entry, left, top_in)
            left += _SAMPLE_IN + max(width_in(line, _SIZE) for line in entry.text) + _GAP_IN
        top_in -= max(entry.height_in for entry in row)


def draw_column(axis: Axes, entries: Sequence[Entry], top_in: float) -> None:
    """The same, one entry below the other."""
    for entry in entries:
        _draw(axis, entry, 0.0, top_in)
        top_in -= entry.height_in


# --- inside -----------------------------------------------------------------------------------------------------------


def _same_varied(chart: Chart) -> list[str] | None:
    """The keys that vary, if they are the same in all lines where any do."""
    found = {tuple(line.varied) for line in chart.lines if line.varied}
    return list(found.pop()) if len(found) == 1 else None if found else []


def _draw(axis: Axes, entry: Entry, left: float, top: float) -> None:
    middle = top - 0.5 * _LINE_IN
    entry.sample(axis, left, middle)
    for line in entry.text:
        axis.text(left + _SAMPLE_IN, middle, plain(line), fontsize=_SIZE, va="center_baseline")
        middle -= _LINE_IN
    for line in entry.small:
        axis.text(left + _SAMPLE_IN, middle, plain(line), fontsize=_SMALL, color="0.3", va="center_baseline")
        middle -= 0.95 * _LINE_IN


def _sample(**style: Any) -> Sample:
    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.plot(left + 0.5 * _STROKE_IN, middle, **style)

    return draw


def _stroke(**style: Any) -> Sample:
    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.plot([left, left + _STROKE_IN], [middle, middle], **style)

    return draw


def _line_sample(number: int) -> Sample:
    style = style_of(number)

    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.plot([left, left + _STROKE_IN], [middle, middle], **line_style(style))
        axis.plot(left + 0.5 * _STROKE_IN, middle, **marker(style, True))

    return draw


def _words(text: str) -> Sample:
    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.text(left + 0.5 * _STROKE_IN, middle, plain(text), fontsize=LABEL_SIZE, ha="center", va="center_baseline")

    return draw


def _band_sample(axis: Axes, left: float, middle: float) -> None:
    axis.add_patch(Rectangle((left, middle - 0.05), _STROKE_IN, 0.1, **BAND))


def _bar_sample(axis: Axes, left: float, middle: float) -> None:
    axis.errorbar(left + 0.5 * _STROKE_IN, middle, xerr=0.12, fmt="none", ecolor="0.3", elinewidth=1.0, capsize=2.5)
