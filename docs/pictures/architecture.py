"""Draws the project in one picture: `python docs/pictures/architecture.py` (a second).

Above, the floors of the house, of which each imports only those below it. Below, the way of a field in one solve.
"""

from pathlib import Path

from canvas import BLACK, GREY, IMAGES, PALE, drawing, save
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

#: What is in a floor, from the top down.
FLOORS = {
    "cli": "the command cosim",
    "report": "figures, report page, movies, comparison",
    "studies": "many runs: charts, tuning, error budgets, stability maps",
    "orchestrator": "the master: scenario, schemes, exchange, results, SSP",
    "fmus": "packaging: any unit as an FMU of FMI 2.0 or 3.0",
    "units": "physics: meshes, fibres, waves, active stress, mechanics",
}


def _box(axes: Axes, left: float, top: float, wide: float, tall: float, face: str = "white") -> None:
    axes.add_patch(
        FancyBboxPatch(
            (left, top),
            wide,
            tall,
            boxstyle="round,pad=0,rounding_size=1.2",
            facecolor=face,
            edgecolor=BLACK,
            linewidth=0.9,
        )
    )


def _arrow(axes: Axes, begin: tuple[float, float], end: tuple[float, float], style: str = "-|>") -> None:
    axes.add_patch(
        FancyArrowPatch(
            begin, end, arrowstyle=style, mutation_scale=9, linewidth=1.1, color=BLACK, shrinkA=0, shrinkB=0, zorder=6
        )
    )


def _floors(axes: Axes, top: float) -> float:
    tall, gap = 10.5, 2.2
    for number, (name, text) in enumerate(FLOORS.items()):
        y = top + number * (tall + gap)
        _box(axes, 2.0, y, 89.0, tall, PALE)
        axes.text(4.5, y + 3.4, name, va="center", fontsize=10.5, fontweight="bold")
        axes.text(4.5, y + 7.5, text, va="center", fontsize=9.5)
    bottom = top + len(FLOORS) * (tall + gap) - gap
    _arrow(axes, (94.5, top + 1.0), (94.5, bottom - 1.0))
    axes.text(97.5, (top + bottom) / 2, "imports", rotation=90, ha="center", va="center", fontsize=9.5, color=GREY)
    return bottom


def _way(axes: Axes, top: float) -> None:
    axes.text(2.0, top, "The way of a field in one solve", va="top", fontsize=10.5, fontweight="bold")
    tall, middle = 9.5, 31.0
    rows = [
        ("exchange", "latest values; extrapolation; history"),
        ("participant", "set, ramp, do_step, get"),
        ("FMI 2.0 or 3.0", "one call per array"),
        ("wrapper in C", "memory shared with Python"),
        ("unit", "the solve, in NumPy and C"),
    ]
    y = top + 7.0
    for number, (name, text) in enumerate(rows):
        _box(axes, 14.0, y, 72.0, tall, PALE if number in (0, 4) else "white")
        axes.text(16.5, y + 3.0, name, va="center", fontsize=10, fontweight="bold")
        axes.text(16.5, y + 6.9, text, va="center", fontsize=9.5)
        if number < len(rows) - 1:
            _arrow(axes, (middle, y + tall), (middle, y + tall + 4.0))
            _arrow(axes, (100.0 - middle, y + tall + 4.0), (100.0 - middle, y + tall))
        y += tall + 4.0
    first, last = top + 7.0 + tall / 2, y - 4.0 - tall / 2
    # Native participants call the unit themselves.
    second = first + tall + 4.0
    for begin, end in (((86.0, second), (92.0, second)), ((92.0, second), (92.0, last)), ((92.0, last), (86.0, last))):
        _arrow(axes, begin, end, "-" if end != (86.0, last) else "-|>")
    axes.text(
        95.5, (second + last) / 2, "native: no FMI", rotation=90, ha="center", va="center", fontsize=9.5, color=GREY
    )
    axes.text(
        7.5, (first + last) / 2, "inputs ↓  outputs ↑", rotation=90, ha="center", va="center", fontsize=9.5, color=GREY
    )


def draw(folder: Path = IMAGES) -> Path:
    """The floors, and the way of a field."""
    picture, axes = drawing(7.35, 154.0)
    bottom = _floors(axes, 2.0)
    _way(axes, bottom + 4.5)
    return save(picture, "architecture", folder)


if __name__ == "__main__":
    print(draw())
