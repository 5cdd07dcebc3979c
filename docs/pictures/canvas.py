"""How the pictures of the pages look: as wide as a telephone shows them, in black and white, as text that stays sharp.

A picture of 4.8 inches is 460 pixels wide on a page. A page of 375 pixels shows it at three quarters of that, and
letters of 10 points are still read there.
"""

from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

#: Where the pages look for them.
IMAGES = Path(__file__).parent.parent / "images" / "theory"

WIDTH_IN = 4.8

#: Ink for what matters, and for what goes with it.
BLACK, GREY, PALE = "#000000", "#6e6e6e", "#ececec"


def figure(height_in: float) -> Figure:
    """An empty figure of the usual width."""
    matplotlib.rcParams.update(
        {
            "font.size": 10,
            "svg.fonttype": "path",
            # The same picture is the same file.
            "svg.hashsalt": "cardiac-cosim",
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.formatter.use_mathtext": True,
        }
    )
    return Figure(figsize=(WIDTH_IN, height_in), facecolor="white", layout="constrained")


def drawing(height_in: float, height: float, width: float = 100.0) -> tuple[Figure, Axes]:
    """A figure without axes, whose coordinates run from 0 to `width` and, downwards, from 0 to `height`."""
    picture = figure(height_in)
    picture.set_layout_engine("none")
    axes = picture.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width)
    axes.set_ylim(height, 0.0)
    return picture, axes


def save(picture: Figure, name: str, folder: Path = IMAGES) -> Path:
    """Write the picture as `name`.svg."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.svg"
    picture.savefig(file, metadata={"Date": None})
    return file
