"""A loop that answers at once, with its input extrapolated: by what an explicit step multiplies an error.

    x_{n+1} = g x̂_{n+1},   x̂ the polynomial of order p through the last p + 1 values:   1 = g (1 − (1 − 1/z)^(p+1))

`python docs/pictures/extrapolated_loop.py` draws the largest |z| over the gain (a second).
"""

from pathlib import Path

import numpy as np
from canvas import BLACK, GREY, IMAGES, figure, save


def growth(gain: float, order: int) -> float:
    """The largest |z| of an explicit Gauss–Seidel loop."""
    # In ζ = 1/z, which is simpler: g (1 − (1 − ζ)^(p+1)) − 1 = 0.
    beyond = np.polynomial.Polynomial([1.0, -1.0]) ** (order + 1)
    return float(1.0 / np.abs((gain * (1.0 - beyond) - 1.0).roots()).min())


def limit(order: int) -> float:
    """The negative gain from which on it grows, where z = −1."""
    return -1.0 / (2.0 ** (order + 1) - 1.0)


def draw(folder: Path = IMAGES) -> Path:
    """|z| over the gain, for the three orders of extrapolation."""
    picture = figure(3.6)
    axes = picture.add_subplot()
    gains = np.linspace(-1.2, 1.2, 481)
    gains = gains[gains != 0.0]
    for order, style, label in ((2, ":", "$p = 2$"), (1, "--", "$p = 1$"), (0, "-", "$p = 0$")):
        axes.plot(gains, [growth(gain, order) for gain in gains], style, color=BLACK, linewidth=1.6, label=label)
        axes.plot([limit(order)], [1.0], "o", color=BLACK, markersize=5)
    axes.axhline(1.0, color=GREY, linewidth=0.8, zorder=0)
    for order, name in ((0, "$-1$"), (1, r"$-\frac{1}{3}$"), (2, r"$-\frac{1}{7}$")):
        axes.annotate(name, (limit(order), 1.0), (-4, -4), textcoords="offset points", ha="right", va="top")
    axes.set_xlim(-1.2, 1.2)
    axes.set_ylim(0.0, 2.0)
    axes.set_xlabel("gain $g$ of the loop")
    axes.set_ylabel("factor per step, largest $|z|$")
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(0.5, 1.03), title="extrapolation")
    return save(picture, "extrapolated_loop", folder)


if __name__ == "__main__":
    print(draw())
