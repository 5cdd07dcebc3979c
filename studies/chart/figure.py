"""A chart as a figure: error against cost, a row for each measure, over seconds and, beside that, over solves."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ...orchestrator.quoting import shortened
from ..pictures.legend import Entry, draw_column, draw_rows, rows_height_in
from ..pictures.lettering import broken, plain
from ..pictures.picture_files import write_figure
from ..pictures.provenance import machine_text, note_texts
from ..pictures.sheet import axes_at, words_at, write_lines
from .caption import cost_text, reference_text
from .chart import Chart
from .drawn_panel import STRIP_ROW_IN, draw_panel, has_arrows, strip_rows, without_cost
from .footnotes import Footnotes, footnotes
from .key import line_entries, sign_entries
from .panel import Panel, panel, views

_DOTS_PER_INCH = 160

#: Inches: the sheet; what is left of the panels, between them, and right of them; the panels, with their labels below.
_WIDTH, _MARGIN = 10.0, 0.12
_LEFT, _GAP, _PANEL, _HEIGHT, _BELOW = 0.95, 0.2, 3.1, 2.75, 0.55
_LEGEND = _WIDTH - _LEFT - 2 * _PANEL - 2 * _GAP - _MARGIN

#: A legend that is higher than this stands below the panels, in columns, and the panels are as wide as the sheet.
_HIGHEST, _COLUMNS = 4.2, 4

_TITLE_SIZE, _LABEL_SIZE, _TEXT_SIZE, _LINE_IN = 13.0, 10.0, 9.0, 0.16

#: Footnotes that a figure has room for.
_MOST_NOTES = 15

_LONGEST = 600


def draw(chart: Chart) -> Figure:
    """The whole chart on one sheet."""
    notes = footnotes(chart)
    rows = [_Row(chart, [panel(chart, measure, view) for view in views(chart)]) for measure in chart.measures]
    width = _WIDTH - 2 * _MARGIN
    title = broken(
        shortened(f"{chart.name}: error against cost, {Path(chart.scenario).name}", _LONGEST), _TITLE_SIZE, width
    )
    signs = sign_entries(chart, [each for row in rows for each in row.panels], width)
    words = _below(chart, notes, width)
    head = 0.1 + 0.25 * len(title) + rows_height_in(signs) + 0.1
    foot = _LINE_IN * len(words) + 0.15
    height = head + sum(row.height for row in rows) + foot
    figure = Figure(figsize=(_WIDTH, height), dpi=_DOTS_PER_INCH)
    sheet = words_at(figure, (0.0, 0.0, _WIDTH, height))
    write_lines(sheet, title, _MARGIN, height - 0.1, 0.25, fontsize=_TITLE_SIZE, weight="bold")
    key = words_at(figure, (_MARGIN, 0.0, width, height))
    draw_rows(key, signs, height - 0.1 - 0.25 * len(title) - 0.04)
    top = height - head
    for row in rows:
        row.draw(figure, top, chart, notes)
        top -= row.height
    write_lines(sheet, words, _MARGIN, foot - 0.05, _LINE_IN, fontsize=_TEXT_SIZE, color="0.2")
    return figure


def write_figures(chart: Chart, folder: Path, stem: str = "chart") -> list[Path]:
    """Write `chart.png` and `chart.svg` into `folder`, or the same called after `stem`; returns the files."""
    return write_figure(draw(chart), folder, stem)


# --- inside -----------------------------------------------------------------------------------------------------------


class _Row:
    """The panels of one measure, and their legend beside or below them."""

    def __init__(self, chart: Chart, panels: Sequence[Panel]) -> None:
        self.panels = panels
        entries = line_entries(chart, panels[0], _LEGEND)
        beside = _height_in(entries)
        self._is_beside = beside <= _HIGHEST
        if self._is_beside:
            self._columns, self._column = [entries], _LEGEND
            self._width = _PANEL
        else:
            self._column = (_WIDTH - _LEFT - _MARGIN) / _COLUMNS
            entries = line_entries(chart, panels[0], self._column)
            count = -(-len(entries) // _COLUMNS)
            self._columns = [entries[begin : begin + count] for begin in range(0, len(entries), count)]
            self._width = 0.5 * (_WIDTH - _LEFT - _GAP - 2 * _MARGIN)
        strips = max(strip_rows(len(without_cost(each)), self._width) for each in panels)
        self._above = STRIP_ROW_IN * (strips + any(map(has_arrows, panels))) + 0.12
        self._panel = max(_HEIGHT, beside - _BELOW) if self._is_beside else _HEIGHT * self._width / _PANEL
        self._legend = self._panel + _BELOW if self._is_beside else max(map(_height_in, self._columns)) + 0.1
        self.height = self._above + self._panel + _BELOW + (0.0 if self._is_beside else self._legend)

    def draw(self, figure: Figure, top: float, chart: Chart, notes: Footnotes) -> None:
        """Draw it from `top`, in inches above the lower edge of the sheet."""
        bottom = top - self._above - self._panel
        for number, each in enumerate(self.panels):
            left = _LEFT + number * (self._width + _GAP)
            axis = axes_at(figure, (left, bottom, self._width, self._panel))
            draw_panel(axis, each, chart.lines, notes)
            if number:
                axis.tick_params(axis="y", which="both", labelleft=False)
            else:
                axis.set_ylabel("\n".join(map(plain, self._label(each))), fontsize=_LABEL_SIZE)
                # All rows have it at the same place, and none beyond the sheet.
                axis.yaxis.set_label_coords((0.22 - left) / self._width, 0.5)
                axis.yaxis.label.set_verticalalignment("center")
        left = _WIDTH - _LEGEND - _MARGIN if self._is_beside else _LEFT
        legend_bottom = bottom - _BELOW - (0.0 if self._is_beside else self._legend)
        for number, entries in enumerate(self._columns):
            place = (left + number * self._column, legend_bottom, self._column, self._legend)
            draw_column(words_at(figure, place), entries, self._legend)

    def _label(self, each: Panel) -> list[str]:
        unit = f" ({each.measure.unit})" if each.measure.unit else ""
        return broken(f"{each.measure.description}{unit}", _LABEL_SIZE, self._panel)


def _height_in(entries: Sequence[Entry]) -> float:
    return sum(entry.height_in for entry in entries)


def _below(chart: Chart, notes: Footnotes, width: float) -> list[str]:
    """Lines of text under the panels."""
    texts = [f"{number}: {text}" for number, text in enumerate(notes.texts, start=1)]
    if len(texts) > _MOST_NOTES:
        left_out = len(texts) - _MOST_NOTES
        texts = [*texts[:_MOST_NOTES], f"{left_out} more reasons are in the table and on the page of this chart."]
    caption = [reference_text(chart), cost_text(chart)]
    if any(line.orders for line in chart.lines):
        caption.append(
            "The order is the observed order of accuracy: the error grows as this power of the varied number."
        )
    caption += [machine_text(chart.machine), *note_texts(chart.notes)]
    caption = [shortened(text, _LONGEST) for text in caption if text]
    lines = [line for text in texts for line in broken(text, _TEXT_SIZE, width)]
    return [*lines, *[""] * bool(lines), *broken(" ".join(caption), _TEXT_SIZE, width)]
