"""Where cells of a map turn from stable to something else, found by halving the distance between two of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from .axis import Axis
from .map import NOT_RUN, Cell

#: Whether a cell is on the good side of the boundary.
Holds = Callable[[Cell], bool]


@dataclass(frozen=True)
class Bracket:
    """Two cells at the same x, next to each other along y, of which one holds and the other does not.

    One that is `closed` is not halved any more: there is no value between the two, or none that can be run.
    """

    low: Cell
    high: Cell
    closed: bool = False

    @property
    def x(self) -> Any:
        """Where it is."""
        return self.low.x

    def halved(self, middle: Cell | None, holds: Holds) -> "Bracket":
        """The half of it that has the boundary; `middle` is None where the scenario cannot have a value there."""
        if middle is None or middle.kind == NOT_RUN:
            return replace(self, closed=True)
        if holds(middle) == holds(self.low):
            return replace(self, low=middle)
        return replace(self, high=middle)


def brackets(x: Axis, y: Axis, cells: Sequence[Cell], holds: Holds) -> list[Bracket]:
    """All that there are between neighbours of the grid; none where y has no order. What was not run, is left out."""
    if not y.is_numeric:
        return []
    found = []
    for value in x.values:
        column = sorted((cell for cell in cells if cell.x == value), key=lambda cell: cell.y)
        ran = [(low, high) for low, high in pairwise(column) if NOT_RUN not in (low.kind, high.kind)]
        found += [Bracket(low, high) for low, high in ran if holds(low) != holds(high)]
    return found


def middle(y: Axis, bracket: Bracket) -> float | None:
    """The value to be tried next; None where the bracket is closed, or as narrow as values are told."""
    value = y.between(bracket.low.y, bracket.high.y)
    return value if not bracket.closed and bracket.low.y < value < bracket.high.y else None
