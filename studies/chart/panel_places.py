"""Where the panels of a chart are on the page, and what Plotly calls their axes."""

from dataclasses import dataclass
from typing import Any

from ..pictures.markup import safe_lines
from .chart import Chart

#: Pixels: a panel, at least and at most, what is above and below it, and a line of its legend.
_PANEL, _TALLEST, _ABOVE, _BELOW, _ENTRY = 330, 600, 44, 62, 21

#: Pixels above and below them all.
HEAD_PX, FOOT_PX = 56, 10

#: Letters in a line of the legend.
LETTERS = 34


@dataclass(frozen=True)
class Places:
    """Where the panel `number` of a measure is, from top to bottom in parts of the plot, and its axes and legend.

    The legend has room for `legend_px` pixels from the top of the panel.
    """

    number: int
    count: int
    top: float
    bottom: float
    strip: tuple[float, float]
    legend_px: int

    @property
    def axes(self) -> dict[str, Any]:
        """The panel's axes, as a trace names them."""
        return {"xaxis": f"x{suffix(self.number)}", "yaxis": f"y{suffix(self.number)}"}

    @property
    def strip_axes(self) -> dict[str, Any]:
        """Those of the strip above it, for points without a result."""
        number = self.count + self.number
        return {"xaxis": f"x{suffix(number)}", "yaxis": f"y{suffix(number)}"}

    @property
    def legend(self) -> str:
        """The panel's legend, as a trace names it."""
        return f"legend{suffix(self.number)}"


def suffix(number: int) -> str:
    """What Plotly adds to the name of an axis or legend, of which the first has none."""
    return "" if number == 0 else str(number + 1)


def places_of(chart: Chart) -> tuple[list[Places], int]:
    """Where every measure's panel is, and the height of the whole in pixels."""
    entries = sum(safe_lines(line.name, LETTERS).count("<br>") + 2 for line in chart.lines) + 4
    # A longer legend is scrolled.
    height = min(max(_PANEL, _ENTRY * entries), _TALLEST)
    row, count = _ABOVE + height + _BELOW, len(chart.measures)
    inner = row * count
    found = []
    for number in range(count):
        top = 1.0 - (number * row + _ABOVE) / inner
        strip = (top + 8 / inner, top + 34 / inner)
        found.append(Places(number, count, top, top - height / inner, strip, height + _BELOW))
    return found, inner + HEAD_PX + FOOT_PX
