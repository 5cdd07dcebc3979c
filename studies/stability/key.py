"""What the signs of a map mean: its classes with the numbers of their cells, boundaries, and runs between the grid."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from ..pictures.legend import Entry, Sample, area_sample, in_rows
from .counts import counted
from .drawn_panel import draw_crossing, draw_limit, draw_mark
from .look import LOOKS
from .map import StabilityMap
from .placed_panel import PlacedPanel

#: Inches: the height of a swatch, of a measured boundary's bar, and the width of the sign of a run between.
_SWATCH_IN, _BAR_IN, _STRIP_IN = 0.145, 0.065, 0.32

MEASURED, BETWEEN = "measured boundary", "run of the bisection"


def theory_words(found: StabilityMap) -> str:
    """What the line of the predicted boundary is called."""
    return f"theory: {found.formula or found.theory}"


def entries(found: StabilityMap, placed: Sequence[PlacedPanel], longest_in: float) -> list[list[Entry]]:
    """Rows of entries for the signs that occur: a row of classes, and one of boundaries."""
    numbers = counted(found.cells)
    classes = [(area_sample(_SWATCH_IN, **LOOKS[kind].area), f"{kind} ({numbers[kind]})") for kind in numbers]
    signs: list[tuple[Sample, str]] = []
    if any(each.limit for each in placed):
        signs.append((_limit_sample, theory_words(found)))
    if any(each.crossings for each in placed):
        signs.append((_crossing_sample, MEASURED))
    marks = [mark for each in placed for mark in each.marks]
    if marks:
        signs.append((_mark_sample(marks[0].cell.kind), BETWEEN))
    return [row for row in (*in_rows(classes, longest_in), *in_rows(signs, longest_in)) if row]


# --- inside -----------------------------------------------------------------------------------------------------------


def _limit_sample(axis: Axes, left: float, middle: float) -> None:
    draw_limit(axis, [left, left + _STRIP_IN], [middle, middle])


def _crossing_sample(axis: Axes, left: float, middle: float) -> None:
    draw_crossing(axis, left + 0.5 * _STRIP_IN, middle, middle - _BAR_IN, middle + _BAR_IN)


def _mark_sample(kind: str) -> Sample:
    def draw(axis: Axes, left: float, middle: float) -> None:
        draw_mark(axis, left, left + _STRIP_IN, middle, kind)

    return draw
