"""Labels at the axes of a map: the values of its grid where there is room for them, in lines that fit their boxes."""

from dataclasses import dataclass
from itertools import pairwise

from ..pictures.lettering import name_lines, width_in
from .placed_axis import PlacedAxis

SIZE, LINE_IN = 8.5, 0.145

#: Inches between labels, and from the axis to them.
_AIR_IN, _AWAY_IN = 0.08, 0.08

#: Inches: a label below a narrower box is turned, and is then as long as this; the longest label beside the axis.
_NARROW_IN, _TURNED_IN, _BESIDE_IN = 0.62, 1.3, 1.25

#: Inches that labels need where they are not those of the grid: of powers of ten, or a few numbers.
_OTHER_IN = 0.42


@dataclass(frozen=True)
class TickLabels:
    """`lines` of the label at each value of `axis`; None where these have no room and other numbers stand there.

    `across_in` and `up_in` are the inches that the labels need across and up, with the distance from the axis in the
    direction away from it.
    """

    axis: PlacedAxis
    lines: list[list[str]] | None
    rotation: float
    across_in: float
    up_in: float
    size: float = SIZE


def labels_below(axis: PlacedAxis, width: float) -> TickLabels:
    """Labels below an axis that is `width` inches wide."""
    if axis.is_number:
        sizes = [width_in(label, SIZE) for label in axis.labels]
        if _have_room(axis, width, sizes):
            return TickLabels(axis, [[label] for label in axis.labels], 0.0, width, LINE_IN + _AWAY_IN)
        return TickLabels(axis, None, 0.0, width, LINE_IN + _AWAY_IN)
    box = width / max(len(axis.values), 1) - _AIR_IN
    longest = max((width_in(word, SIZE) for label in axis.labels for word in label.split()), default=0.0)
    if longest > box and box < _NARROW_IN:
        lines = [name_lines(label, SIZE, _TURNED_IN)[: max(int((box + _AIR_IN) / LINE_IN), 1)] for label in axis.labels]
        return TickLabels(axis, lines, 90.0, width, _widest(lines) + _AWAY_IN)
    lines = [name_lines(label, SIZE, box) for label in axis.labels]
    return TickLabels(axis, lines, 0.0, width, LINE_IN * max(map(len, lines), default=1) + _AWAY_IN)


def labels_beside(axis: PlacedAxis, height: float) -> TickLabels:
    """Labels to the left of an axis that is `height` inches high, or `up_in` if that is more."""
    if axis.is_number:
        if _have_room(axis, height, [LINE_IN] * len(axis.places)):
            lines = [[label] for label in axis.labels]
            return TickLabels(axis, lines, 0.0, _widest(lines) + _AWAY_IN, height)
        return TickLabels(axis, None, 0.0, _OTHER_IN + _AWAY_IN, height)
    lines = [name_lines(label, SIZE, _BESIDE_IN) for label in axis.labels]
    needed = len(lines) * (LINE_IN * max(map(len, lines), default=1) + _AIR_IN)
    return TickLabels(axis, lines, 0.0, _widest(lines) + _AWAY_IN, max(height, needed))


# --- inside -----------------------------------------------------------------------------------------------------------


def _have_room(axis: PlacedAxis, length: float, sizes: list[float]) -> bool:
    places = [part * length for part in axis.parts]
    return all(
        other - one >= 0.5 * (size + next_size) + _AIR_IN
        for (one, other), (size, next_size) in zip(pairwise(places), pairwise(sizes), strict=True)
    )


def _widest(lines: list[list[str]]) -> float:
    return max((width_in(line, SIZE) for label in lines for line in label), default=0.0)
