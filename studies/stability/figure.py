"""A map as a figure: one panel, or several in two columns, with one legend above and what they come from below."""

from pathlib import Path

from matplotlib.figure import Figure

from ...orchestrator.quoting import shortened
from ..pictures.legend import draw_rows, rows_height_in
from ..pictures.lettering import broken, name_lines, plain
from ..pictures.picture_files import write_figure
from ..pictures.sheet import axes_at, words_at, write_lines
from .axis_words import pair_words
from .caption import sentences, title
from .drawn_panel import draw_panel
from .key import entries
from .map import StabilityMap
from .placed_panel import PlacedPanel, placed_panel
from .tick_labels import labels_below, labels_beside

_DOTS_PER_INCH = 160

#: Inches: the sheet, its margins, the space between panels, and the height of one panel and of one of several.
_WIDTH, _MARGIN, _GAP = 8.0, 0.12, 0.2
_TALL, _LOW = 3.9, 2.7

_TITLE_SIZE, _NAME_SIZE, _LABEL_SIZE, _TEXT_SIZE = 13.0, 10.0, 10.0, 8.5

#: Inches from line to line of the title, of panels' names, of the axes' labels and of the text below.
_TITLE_IN, _NAME_IN, _LABEL_IN, _LINE_IN = 0.25, 0.18, 0.18, 0.15

_LONGEST = 600


def draw(found: StabilityMap) -> Figure:
    """The whole map on one sheet; ValueError for a cell that is neither on its grid nor bisected."""
    placed = [placed_panel(panel) for panel in found.panels]
    width = _WIDTH - 2 * _MARGIN
    heading = broken(shortened(title(found), _LONGEST), _TITLE_SIZE, width)
    key = entries(found, placed, width)
    words = broken(" ".join(shortened(text, _LONGEST) for text in sentences(found, placed)), _TEXT_SIZE, width)
    columns = min(len(placed), 2)
    column = (width - (columns - 1) * _GAP) / max(columns, 1)
    panels = [_Place(each, column, _TALL if columns == 1 else _LOW) for each in placed]
    rows = [panels[begin : begin + columns] for begin in range(0, len(panels), max(columns, 1))]
    head = 0.1 + _TITLE_IN * len(heading) + 0.06 + rows_height_in(key) + 0.06
    foot = _LINE_IN * len(words) + 0.14
    height = head + sum(map(_height, rows)) + foot
    figure = Figure(figsize=(_WIDTH, height), dpi=_DOTS_PER_INCH)
    sheet = words_at(figure, (0.0, 0.0, _WIDTH, height))
    write_lines(sheet, heading, _MARGIN, height - 0.1, _TITLE_IN, fontsize=_TITLE_SIZE, weight="bold")
    write_lines(sheet, words, _MARGIN, foot - 0.05, _LINE_IN, fontsize=_TEXT_SIZE, color="0.2")
    draw_rows(words_at(figure, (_MARGIN, 0.0, width, height)), key, height - 0.1 - _TITLE_IN * len(heading) - 0.06)
    top = height - head
    for row in rows:
        above = max(each.above for each in row)
        for number, each in enumerate(row):
            each.draw(figure, _MARGIN + number * (column + _GAP), top - above)
        top -= _height(row)
    return figure


def write_figures(found: StabilityMap, folder: Path, stem: str = "stability") -> list[Path]:
    """Write `stability.png` and `stability.svg` into `folder`, or the same called after `stem`; returns the files."""
    return write_figure(draw(found), folder, stem)


# --- inside -----------------------------------------------------------------------------------------------------------


class _Place:
    """What a panel needs in a column of this width: inches above, of its axes, and below."""

    def __init__(self, placed: PlacedPanel, column: float, height: float) -> None:
        self._placed = placed
        x, y = pair_words(placed.panel.x_key, placed.panel.y_key)
        self._up = labels_beside(placed.y, height)
        self._height = self._up.up_in
        self._y_words = name_lines(y, _LABEL_SIZE, self._height)
        self._left = _LABEL_IN * len(self._y_words) + 0.05 + self._up.across_in
        # Half of the last number stands right of the axes.
        self._width = column - self._left - 0.15
        self._name = name_lines(placed.panel.name, _NAME_SIZE, self._width)
        self._across = labels_below(placed.x, self._width)
        self._x_words = name_lines(x, _LABEL_SIZE, self._width)
        self.above = _NAME_IN * len(self._name) + 0.08
        self.below = self._height + self._across.up_in + _LABEL_IN * len(self._x_words) + 0.2

    def draw(self, figure: Figure, left: float, top: float) -> None:
        """Draw it with the upper edge of its axes at `top`."""
        begin, bottom = left + self._left, top - self._height
        axis = axes_at(figure, (begin, bottom, self._width, self._height))
        draw_panel(axis, self._placed, self._across, self._up)
        axis.set_title("\n".join(map(plain, self._name)), fontsize=_NAME_SIZE, loc="left", pad=4.0)
        axis.set_xlabel("\n".join(map(plain, self._x_words)), fontsize=_LABEL_SIZE)
        axis.xaxis.set_label_coords(0.5, -(self._across.up_in + 0.07) / self._height)
        axis.xaxis.label.set_verticalalignment("top")
        axis.set_ylabel("\n".join(map(plain, self._y_words)), fontsize=_LABEL_SIZE)
        axis.yaxis.set_label_coords(-(self._up.across_in + 0.05) / self._width, 0.5)
        axis.yaxis.label.set_verticalalignment("bottom")


def _height(row: list[_Place]) -> float:
    return max(each.above for each in row) + max(each.below for each in row)
