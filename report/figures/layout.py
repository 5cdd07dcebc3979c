"""How the figures in space are laid out: their width, the sizes of their letters, rows of panels, colour bars.

A figure is 6.4 inches wide, so that letters of 10 points are still legible where it is shown 375 pixels wide. Where the
panels do not fill the last row they stand in its middle.
"""

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch

from .plot_axes import WIDTH

#: The letters of titles and of all else in points.
TITLE_PT, TEXT_PT = 11.0, 10.0

#: Small pictures side by side.
COLUMNS = 3

# Height of a line of text, and of a colour bar with ticks and label, in inches.
_LINE_IN, _BAR_IN = 0.19, 0.62

# Width of a letter relative to its height, on the average.
_LETTER = 0.5


class Panels(NamedTuple):
    """A figure and its panels, row by row."""

    figure: Figure
    axes: list[Axes]


def panels(
    count: int, columns: int, aspect: float, *, title_lines: int = 1, below_in: float = 0.0, square: bool = False
) -> Panels:
    """A figure of `count` panels, at most `columns` in a row.

    Parameters
    ----------
    aspect:
        Height of a panel over its width.
    title_lines:
        Lines in the longest title of a panel.
    below_in:
        Height in inches of what is added below the panels, a colour bar say.
    square:
        A single panel is not wider than half of two.
    """
    columns = min(count, columns)
    rows = -(-count // columns)
    width = WIDTH / max(columns, 2) if square else WIDTH / columns
    height = rows * (width * aspect + title_lines * _LINE_IN + 0.18) + below_in + 0.3
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.08))
    # Two places a panel: so the last row can be shifted by half a panel.
    grid = figure.add_gridspec(rows, 2 * columns)
    axes = []
    for number in range(count):
        row, column = divmod(number, columns)
        missing = columns - min(columns, count - row * columns)
        axes.append(figure.add_subplot(grid[row, 2 * column + missing : 2 * column + missing + 2]))
    return Panels(figure, axes)


#: What `panels` needs below them for `color_bar`, and for `legend` of one row.
BAR_IN, LEGEND_IN = _BAR_IN, 0.35


def color_bar(
    shown: Panels, colors: ScalarMappable, label: str, *, ticks: Sequence[float] | None = None, extend: str = "neither"
) -> Colorbar:
    """The colour bar below all panels; `label` ends in the unit of measure."""
    bar = shown.figure.colorbar(
        colors, ax=shown.axes, location="bottom", shrink=0.8, aspect=38, pad=0.02, extend=extend, ticks=ticks
    )
    bar.set_label(label, fontsize=TITLE_PT)
    bar.ax.tick_params(labelsize=TEXT_PT)
    return bar


def legend(shown: Panels, entries: dict[str, tuple[float, float, float]]) -> None:
    """Names and their colours below all panels."""
    handles = [Patch(facecolor=rgb, edgecolor="0.2", label=name) for name, rgb in entries.items()]
    shown.figure.legend(
        handles=handles, loc="outside lower center", ncols=min(len(handles), 3), fontsize=TEXT_PT, frameon=False
    )


def wrapped(text: str, columns: int) -> str:
    """`text` in lines that fit above a panel of which `columns` stand side by side."""
    return "\n".join(textwrap.wrap(text, int(72.0 * WIDTH / columns / (_LETTER * TEXT_PT))))
