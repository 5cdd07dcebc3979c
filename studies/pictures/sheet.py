"""Places on the sheet of a figure, measured in inches from its lower left."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .lettering import plain

#: Left, bottom, width and height.
Place = tuple[float, float, float, float]


def words_at(figure: Figure, place: Place) -> Axes:
    """Axes without a frame whose unit is an inch, for words and their signs."""
    axis = axes_at(figure, place)
    axis.set(xlim=(0.0, place[2]), ylim=(0.0, place[3]))
    axis.set_axis_off()
    return axis


def axes_at(figure: Figure, place: Place) -> Axes:
    """Axes at a place."""
    width, height = figure.get_size_inches()
    return figure.add_axes((place[0] / width, place[1] / height, place[2] / width, place[3] / height))


def write_lines(axis: Axes, lines: Sequence[str], left: float, top: float, line_in: float, **style: Any) -> None:
    """Write lines of text from `left` and `top` down, `line_in` inches apart, letter by letter."""
    for number, line in enumerate(lines):
        axis.text(left, top - line_in * number, plain(line), va="top", **style)
