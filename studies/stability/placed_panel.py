"""A panel of a map with everything at its place: the boxes of its grid, what lies between them, and the boundary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .map import Cell, Crossing, Panel
from .placed_axis import PlacedAxis, placed_axis

#: Places along a piece of the boundary at which is looked whether it is on the map.
_LOOKS = 65

#: Part of a box that the sign of a run between the grid's values is wide.
_WIDE = 0.56


@dataclass(frozen=True)
class Mark:
    """The sign of a run between the values of the grid: a strip from `left` to `right` at the height `y`."""

    cell: Cell
    left: float
    right: float
    y: float


@dataclass(frozen=True)
class PlacedCrossing:
    """A crossing at the place `x`."""

    crossing: Crossing
    x: float


@dataclass(frozen=True)
class PlacedPanel:
    """`boxes` are the cells of the grid by the numbers of their values on the axes, x first.

    `limit` are pieces of the boundary that theory predicts, corners of shape (n, 2), as far as they are on the map.
    """

    panel: Panel
    x: PlacedAxis
    y: PlacedAxis
    boxes: Mapping[tuple[int, int], Cell]
    marks: Sequence[Mark]
    crossings: Sequence[PlacedCrossing]
    limit: Sequence[NDArray[np.float64]]

    def corners(self, box: tuple[int, int]) -> tuple[float, float, float, float]:
        """Left, right, lower and upper edge of a box."""
        across, up = box
        return self.x.edges[across], self.x.edges[across + 1], self.y.edges[up], self.y.edges[up + 1]


def placed_panel(panel: Panel) -> PlacedPanel:
    """The panel at its places; ValueError for a cell that is neither on its grid nor bisected."""
    x, y = placed_axis(panel.xs), placed_axis(panel.ys, from_the_end=True)
    boxes: dict[tuple[int, int], Cell] = {}
    marks = []
    for cell in panel.cells:
        if cell.bisected:
            marks.append(_mark(cell, x, y))
            continue
        across, up = x.number(cell.x), y.number(cell.y)
        if across is None or up is None:
            raise ValueError(f"a cell at ({cell.x!r}, {cell.y!r}) is not on the grid of panel {panel.name!r}")
        boxes[across, up] = cell
    crossings = []
    for crossing in panel.crossings:
        place = x.place(crossing.x)
        if place is not None and y.is_number:
            crossings.append(PlacedCrossing(crossing, place))
    return PlacedPanel(panel, x, y, boxes, marks, crossings, _limit(panel, x, y, crossings))


# --- inside -----------------------------------------------------------------------------------------------------------


def _mark(cell: Cell, x: PlacedAxis, y: PlacedAxis) -> Mark:
    across, up = x.place(cell.x), y.place(cell.y)
    if across is None or up is None:
        raise ValueError(f"a cell at ({cell.x!r}, {cell.y!r}) has no place on its axes")
    low, high = x.box(across)
    return Mark(cell, x.part(low, high, 0.5 - 0.5 * _WIDE), x.part(low, high, 0.5 + 0.5 * _WIDE), up)


def _limit(
    panel: Panel, x: PlacedAxis, y: PlacedAxis, crossings: Sequence[PlacedCrossing]
) -> list[NDArray[np.float64]]:
    """As the theory gives it; where x has no numbers, across the boxes of the values whose limit is known."""
    if not y.is_number:
        return []
    if x.is_number:
        pieces = [np.array(piece, dtype=float).reshape(-1, 2) for piece in panel.limit]
    else:
        pieces = [
            np.array([(low, each.crossing.predicted), (high, each.crossing.predicted)])
            for each in crossings
            if each.crossing.predicted is not None
            for low, high in [x.box(each.x)]
        ]
    return [piece for piece in pieces if _is_seen(piece, x, y)]


def _is_seen(piece: NDArray[np.float64], x: PlacedAxis, y: PlacedAxis) -> bool:
    """Whether any of it is within the edges of both axes; a line is straight as the axes measure it."""
    measured = np.array(piece)
    edges = np.array([[x.edges[0], y.edges[0]], [x.edges[-1], y.edges[-1]]])
    for number, axis in enumerate((x, y)):
        if axis.is_logarithmic:
            if not (measured[:, number] > 0.0).all():
                return False
            measured[:, number] = np.log(measured[:, number])
            edges[:, number] = np.log(edges[:, number])
    parts = np.linspace(0.0, 1.0, _LOOKS)[:, None]
    along = [begin + parts * (end - begin) for begin, end in pairwise(measured)]
    return any(bool(((edges[0] <= each) & (each <= edges[1])).all(axis=1).any()) for each in along)
