"""How the classes of a map look, in the figure and on the page alike: told apart by colour, by grey and by hatching."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.colors import to_hex, to_rgb

from ..pictures.colors import COLORS
from .map import DIVERGED, INACCURATE, NOT_CONVERGED, NOT_RUN, OSCILLATING, SOUND, UNIT_FAILED

#: Side of the square in pixels that repeats in a swatch of the page.
TILE_PX = 8

_BLUE, _VERMILLION, _GREEN, _PURPLE, _ORANGE, _SKY, _BLACK = COLORS


@dataclass(frozen=True)
class Look:
    """`color` fills, `ink` is the colour of the hatching.

    The hatching is `hatch` in Matplotlib's letters, `pattern` in Plotly's, and `tile` as a path of SVG over a square of
    `TILE_PX` pixels.
    """

    color: str
    ink: str
    hatch: str
    pattern: str
    tile: str

    @property
    def area(self) -> dict[str, Any]:
        """As Matplotlib fills an area with it."""
        return {"facecolor": self.color, "edgecolor": self.ink, "hatch": self.hatch, "linewidth": 0.0}


def mixed(color: str, other: str, part: float) -> str:
    """`color` with so large a `part` of another in it."""
    return str(to_hex([(1.0 - part) * one + part * two for one, two in zip(to_rgb(color), to_rgb(other), strict=True)]))


def grey(color: str) -> float:
    """How light a colour is in print without colours, from 0 (black) to 1: the luma of Rec. 709."""
    red, green, blue = to_rgb(color)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


#: By class, from light to dark as it becomes worse: what is sound is calm. A cell that was not run is empty.
LOOKS: Mapping[str, Look] = {
    SOUND: Look(mixed(_GREEN, "white", 0.8), "#ffffff", "", "", ""),
    INACCURATE: Look(mixed(_ORANGE, "white", 0.4), mixed(_ORANGE, "black", 0.5), "..", ".", "M3 3h2v2h-2z"),
    OSCILLATING: Look(
        mixed(_SKY, "white", 0.06), mixed(_BLUE, "black", 0.25), r"\\\\", "\\", "M0 0L8 8M-2 6L2 10M6 -2L10 2"
    ),
    NOT_CONVERGED: Look(mixed(_PURPLE, "white", 0.03), mixed(_PURPLE, "black", 0.65), "xxx", "x", "M0 0L8 8M8 0L0 8"),
    DIVERGED: Look(_VERMILLION, mixed(_VERMILLION, "black", 0.75), "////", "/", "M8 0L0 8M2 -2L-2 2M10 6L6 10"),
    UNIT_FAILED: Look(mixed(_BLACK, "white", 0.3), mixed(_BLACK, "white", 0.75), "++", "+", "M0 4H8M4 0V8"),
    NOT_RUN: Look("#ffffff", mixed(_BLACK, "white", 0.6), "||", "|", "M4 0V8"),
}
