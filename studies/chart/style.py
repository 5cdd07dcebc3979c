"""How the lines of a chart look, in the figure and on the page alike: told apart by colour, by marker and by dashes."""

from dataclasses import dataclass

from ..pictures.colors import COLORS

#: Markers as Matplotlib and as Plotly call them. Crosses are left out: they mark points without results.
_MARKERS = (
    ("o", "circle"),
    ("s", "square"),
    ("^", "triangle-up"),
    ("D", "diamond"),
    ("v", "triangle-down"),
    ("p", "pentagon"),
    (">", "triangle-right"),
    ("*", "star"),
    ("<", "triangle-left"),
    ("h", "hexagon"),
    ("d", "diamond-tall"),
)

#: Lengths of dashes and gaps in line widths.
_DASHES: tuple[tuple[float, ...], ...] = ((), (5, 2), (1, 1.5), (6, 1.5, 1, 1.5), (10, 3), (6, 1.5, 1, 1.5, 1, 1.5))


@dataclass(frozen=True)
class Style:
    """`marker` is Matplotlib's name, `symbol` Plotly's; `dashes` are lengths of dash and gap in line widths."""

    color: str
    marker: str
    symbol: str
    dashes: tuple[float, ...]


def style_of(number: int) -> Style:
    """The style of the line `number` of a chart.

    There are 11 markers and 6 kinds of dashes, so that 66 lines differ in them: print in black and white tells these
    apart.
    """
    marker, symbol = _MARKERS[number % len(_MARKERS)]
    return Style(COLORS[number % len(COLORS)], marker, symbol, _DASHES[number % len(_DASHES)])
