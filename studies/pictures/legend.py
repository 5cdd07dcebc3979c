"""Legends of figures: signs with words beside them, in rows or in a column."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from .lettering import broken, plain, width_in

SIZE, SMALL = 9.5, 8.5

_LINE_IN = 0.165

#: Inches of a sample's line, of a sample with the space beside it, and between entries.
STROKE_IN, SAMPLE_IN, _GAP_IN = 0.32, 0.38, 0.22

#: Draws a sample on axes whose unit is an inch, from its left end, around the middle of its height.
Sample = Callable[[Axes, float, float], None]


@dataclass(frozen=True)
class Entry:
    """Lines of text beside a sample, which is drawn around the middle of the first line; small lines follow."""

    sample: Sample
    text: list[str]
    small: list[str] = field(default_factory=list)

    @property
    def height_in(self) -> float:
        """With the space below."""
        return _LINE_IN * (len(self.text) + 0.95 * len(self.small)) + 0.07

    @property
    def width_in(self) -> float:
        """With the space to the right."""
        return SAMPLE_IN + max(width_in(line, SIZE) for line in self.text) + _GAP_IN


def in_rows(found: Sequence[tuple[Sample, str]], longest_in: float) -> list[list[Entry]]:
    """Signs and their meaning in rows that are not longer than `longest_in` inches."""
    rows: list[list[Entry]] = [[]]
    used = 0.0
    for sample, text in found:
        entry = Entry(sample, broken(text, SIZE, longest_in - SAMPLE_IN))
        if rows[-1] and used + entry.width_in - _GAP_IN > longest_in:
            rows.append([])
            used = 0.0
        rows[-1].append(entry)
        used += entry.width_in
    return rows


def rows_height_in(rows: Sequence[Sequence[Entry]]) -> float:
    """The height of rows of entries in inches."""
    return sum(max(entry.height_in for entry in row) for row in rows if row)


def draw_rows(axis: Axes, rows: Sequence[Sequence[Entry]], top_in: float) -> None:
    """Draw rows of entries on axes whose unit is an inch, from the upper left."""
    for row in rows:
        left = 0.0
        for entry in row:
            _draw(axis, entry, left, top_in)
            left += entry.width_in
        top_in -= rows_height_in([row])


def draw_column(axis: Axes, entries: Sequence[Entry], top_in: float) -> None:
    """The same, one entry below the other."""
    for entry in entries:
        _draw(axis, entry, 0.0, top_in)
        top_in -= entry.height_in


def marker_sample(**style: Any) -> Sample:
    """A marker in Matplotlib's `style`."""

    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.plot(left + 0.5 * STROKE_IN, middle, **style)

    return draw


def line_sample(**style: Any) -> Sample:
    """A piece of a line in Matplotlib's `style`."""

    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.plot([left, left + STROKE_IN], [middle, middle], **style)

    return draw


def word_sample(text: str, size: float) -> Sample:
    """A word as it stands in the picture."""

    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.text(left + 0.5 * STROKE_IN, middle, plain(text), fontsize=size, ha="center", va="center_baseline")

    return draw


def area_sample(height_in: float, **style: Any) -> Sample:
    """A piece of an area in Matplotlib's `style`, so many inches high."""

    def draw(axis: Axes, left: float, middle: float) -> None:
        axis.add_patch(Rectangle((left, middle - 0.5 * height_in), STROKE_IN, height_in, **style))

    return draw


# --- inside -----------------------------------------------------------------------------------------------------------


def _draw(axis: Axes, entry: Entry, left: float, top: float) -> None:
    middle = top - 0.5 * _LINE_IN
    entry.sample(axis, left, middle)
    for line in entry.text:
        axis.text(left + SAMPLE_IN, middle, plain(line), fontsize=SIZE, va="center_baseline")
        middle -= _LINE_IN
    for line in entry.small:
        axis.text(left + SAMPLE_IN, middle, plain(line), fontsize=SMALL, color="0.3", va="center_baseline")
        middle -= 0.95 * _LINE_IN
