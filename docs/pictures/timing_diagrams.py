"""Draws who steps when, and with which inputs: `python docs/pictures/timing_diagrams.py` (a second).

Two units, A and B, feed each other. A box is one solve: a unit's step from one communication point to the next. The
line in it is the input that the unit sees over that step, and the dots at its ends are where it was taken from.
"""

from pathlib import Path

from canvas import BLACK, GREY, IMAGES, PALE, drawing, save
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle

#: Where time begins on the canvas, and how long a step is.
_LEFT, _STEP = 13.0, 41.0
_TALL = 9.0


def _point(number: float) -> float:
    return _LEFT + _STEP * number


def _times(axes: Axes, top: float, bottom: float, steps: int) -> None:
    labels = (r"$t_n$", r"$t_{n+1}$", r"$t_{n+2}$")
    for number in range(steps + 1):
        axes.plot([_point(number)] * 2, [top, bottom], color=GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=0)
        axes.text(_point(number), bottom + 1.0, labels[number], ha="center", va="top")


def _lane(axes: Axes, middle: float, name: str) -> None:
    axes.text(2.0, middle, name, ha="left", va="center", fontsize=11, fontweight="bold")


def _solve(axes: Axes, step: float, middle: float, order: str, line: str) -> None:
    """A box for one solve, its number in the order of computation, and its input.

    `line`: `begin` or `end`, held at the value of that point; `line`, between both; `extrapolated`, beyond the first.
    """
    left, right = _point(step) + 1.2, _point(step + 1) - 1.2
    axes.add_patch(
        Rectangle((left, middle - _TALL / 2), right - left, _TALL, facecolor=PALE, edgecolor=BLACK, linewidth=0.9)
    )
    axes.text((left + right) / 2, middle, order, ha="center", va="center", fontsize=11, color=BLACK, zorder=4)
    low, high, inset = middle + 2.4, middle - 2.4, 2.0
    ends = {"begin": (low, low), "end": (high, high), "line": (low, high), "extrapolated": (low, high)}[line]
    style = {"extrapolated": "--"}.get(line, "-")
    width = 0.5 * (right - left) - inset
    # The number stands in a gap of the line.
    slope, gap = (ends[1] - ends[0]) / (2 * width), 4.0 if order else 0.0
    for begin, end in ((left + inset, left + inset + width - gap), (right - inset - width + gap, right - inset)):
        values = [ends[0] + slope * (place - left - inset) for place in (begin, end)]
        axes.plot([begin, end], values, style, color=BLACK, linewidth=1.4)
    known = {"begin": [0], "end": [1], "line": [0, 1], "extrapolated": [0]}[line]
    for side in (0, 1):
        if side in known or line == "extrapolated":
            filled = BLACK if side in known else "white"
            place = left + inset if side == 0 else right - inset
            axes.plot([place], [ends[side]], "o", color=BLACK, markerfacecolor=filled, markersize=5, zorder=5)


def _arrow(axes: Axes, begin: tuple[float, float], end: tuple[float, float], bend: float = 0.0) -> None:
    axes.add_patch(
        FancyArrowPatch(
            begin,
            end,
            arrowstyle="-|>",
            mutation_scale=9,
            linewidth=1.1,
            color=BLACK,
            connectionstyle=f"arc3,rad={bend}",
            shrinkA=0,
            shrinkB=0,
            zorder=6,
        )
    )


def _title(axes: Axes, top: float, text: str) -> None:
    axes.text(2.0, top, text, ha="left", va="top", fontsize=10.5, fontweight="bold")


def _panel(axes: Axes, top: float, title: str, lines: tuple[str, str], order: tuple[str, str, str, str]) -> None:
    """Two steps of A and B; `lines` are the inputs of A and of B, `order` the numbers of A, B, A, B."""
    _title(axes, top, title)
    first, second = top + 13.0, top + 29.0
    _times(axes, top + 6.0, top + 35.5, 2)
    for name, middle, line, numbers in (("A", first, lines[0], order[::2]), ("B", second, lines[1], order[1::2])):
        _lane(axes, middle, name)
        for step, number in enumerate(numbers):
            _solve(axes, step, middle, number, line)
    inner = (first + _TALL / 2, second - _TALL / 2)
    for step in (0, 1):
        begin, end = _point(step) + 3.2, _point(step + 1) - 3.2
        # A's input comes from B, below; B's from A, above.
        upward = begin if lines[0] in ("begin", "extrapolated") else end
        _arrow(axes, (upward, inner[1]), (upward, inner[0]))
        if lines[0] == "line":
            _arrow(axes, (begin, inner[1]), (begin, inner[0]))
        shift = 2.6
        downward = begin + shift if lines[1] in ("begin", "extrapolated") else end - shift
        _arrow(axes, (downward, inner[0]), (downward, inner[1]))
        if lines[1] == "line":
            _arrow(axes, (begin + shift, inner[0]), (begin + shift, inner[1]))


def _key(axes: Axes, top: float, extrapolated: bool) -> None:
    axes.plot([3.5], [top], "o", color=BLACK, markersize=5)
    axes.text(6.0, top, "a value that is known", ha="left", va="center", fontsize=9.5)
    if extrapolated:
        axes.plot([50.5], [top], "o", color=BLACK, markerfacecolor="white", markersize=5)
        axes.text(53.0, top, "a value that is extrapolated", ha="left", va="center", fontsize=9.5)
    axes.text(
        2.0,
        top + 5.5,
        "1, 2, … order of computation (equal numbers: at the same time)",
        ha="left",
        va="center",
        fontsize=9.5,
    )


def held(folder: Path = IMAGES) -> Path:
    """Zero-order hold."""
    picture, axes = drawing(6.6, 140.0)
    _panel(axes, 1.0, "Jacobi: both see the beginning of the step", ("begin", "begin"), ("1", "1", "2", "2"))
    _panel(axes, 44.5, "Gauss–Seidel: B sees what A has just computed", ("begin", "end"), ("1", "2", "3", "4"))
    _panel(axes, 88.0, "iterated, converged: both see the end of the step", ("end", "end"), ("", "", "", ""))
    _key(axes, 131.0, extrapolated=False)
    return save(picture, "timing_held", folder)


def linear(folder: Path = IMAGES) -> Path:
    """First-order hold."""
    picture, axes = drawing(6.6, 140.0)
    _panel(axes, 1.0, "Jacobi: both extrapolate", ("extrapolated", "extrapolated"), ("1", "1", "2", "2"))
    _panel(axes, 44.5, "Gauss–Seidel: only A extrapolates", ("extrapolated", "line"), ("1", "2", "3", "4"))
    _panel(axes, 88.0, "iterated, converged: nobody does", ("line", "line"), ("", "", "", ""))
    _key(axes, 131.0, extrapolated=True)
    return save(picture, "timing_linear", folder)


def _sweeps(axes: Axes, top: float, title: str, parallel: bool) -> None:
    """Three sweeps over one step, one beside the other."""
    _title(axes, top, title)
    wide, gap, left = 22.0, 9.0, 13.0
    first, second = top + 15.0, top + 31.0
    for middle, name in ((first, "A"), (second, "B")):
        _lane(axes, middle, name)
    for sweep in range(3):
        begin = left + sweep * (wide + gap)
        end = begin + wide
        axes.text(begin + wide / 2, top + 8.6, f"sweep {sweep + 1}", ha="center", va="center", color=GREY, fontsize=9.5)
        for place, (middle, number) in enumerate(((first, 1), (second, 2))):
            order = str(sweep + 1 if parallel else 2 * sweep + number)
            # Gauss–Seidel: B waits for A.
            late = 0.0 if parallel or place == 0 else wide / 2
            axes.add_patch(
                Rectangle(
                    (begin + late, middle - _TALL / 2),
                    wide if parallel else wide / 2,
                    _TALL,
                    facecolor=PALE,
                    edgecolor=BLACK,
                    linewidth=0.9,
                )
            )
            centre = begin + late + (wide if parallel else wide / 2) / 2
            axes.text(centre, middle, order, ha="center", va="center", fontsize=11)
        if not parallel:
            _arrow(axes, (begin + wide / 2, first), (begin + wide / 2 + 3.0, second - _TALL / 2))
        if sweep < 2:
            following = end + gap
            _arrow(axes, (end, second - 2.0), (following, first + 2.0))
            if parallel:
                _arrow(axes, (end, first + 2.0), (following, second - 2.0))
    axes.text(left, second + 8.0, "computing time →", ha="left", va="center", color=GREY, fontsize=9.5)
    axes.text(98.0, second + 8.0, r"every box: $t_n \to t_{n+1}$", ha="right", va="center", color=GREY, fontsize=9.5)


def iterated(folder: Path = IMAGES) -> Path:
    """The sweeps of an iterated step."""
    picture, axes = drawing(4.3, 91.0)
    _sweeps(axes, 1.0, "iterated Gauss–Seidel: one value is carried, from B to A", parallel=False)
    _sweeps(axes, 46.5, "iterated Jacobi: both are carried", parallel=True)
    return save(picture, "timing_iterated", folder)


if __name__ == "__main__":
    for draw in (held, linear, iterated):
        print(draw())
