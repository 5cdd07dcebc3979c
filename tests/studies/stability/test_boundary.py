"""If these fail, the boundary of a map is said to be where none was found, or is halved to where it is not."""

from cardiac_cosim.studies.stability.axis import Axis
from cardiac_cosim.studies.stability.boundary import Bracket, brackets, middle
from cardiac_cosim.studies.stability.map import DIVERGED, INACCURATE, NOT_RUN, SOUND, Cell

_X = Axis("x", ["a", "b"])
_Y = Axis("y", [4, 1, 2, 3])


def _column(x: str, *kinds: str) -> list[Cell]:
    """Cells at the values of y in their order."""
    return [Cell(x, y, kind) for y, kind in zip(_Y.values, kinds, strict=True)]


def test_neighbours_are_those_along_y_whatever_the_order_of_the_study() -> None:
    cells = [*_column("a", DIVERGED, SOUND, SOUND, SOUND), *_column("b", SOUND, DIVERGED, INACCURATE, DIVERGED)]
    found = brackets(_X, _Y, cells, lambda cell: cell.is_stable)
    assert [(each.x, each.low.y, each.high.y) for each in found] == [("a", 3, 4), ("b", 1, 2), ("b", 2, 3), ("b", 3, 4)]
    # Where accuracy counts too, there is no other side between 1 and 3 ms.
    found = brackets(_X, _Y, cells, lambda cell: cell.is_sound)
    assert [(each.x, each.low.y, each.high.y) for each in found] == [("a", 3, 4), ("b", 3, 4)]


def test_what_was_not_run_has_no_side() -> None:
    assert brackets(_X, _Y, _column("a", DIVERGED, SOUND, SOUND, NOT_RUN), lambda cell: cell.is_sound) == []


def test_values_without_an_order_have_no_boundary() -> None:
    axis = Axis("y", [None, {"tolerance": 1}])
    cells = [Cell("a", None, SOUND), Cell("a", {"tolerance": 1}, DIVERGED)]
    assert brackets(_X, axis, cells, lambda cell: cell.is_sound) == []


def test_halving_keeps_one_cell_on_each_side() -> None:
    bracket = Bracket(Cell("a", 1.0, SOUND), Cell("a", 2.0, DIVERGED))
    for _ in range(15):
        value = middle(_Y, bracket)
        assert value is not None
        bracket = bracket.halved(
            Cell("a", value, SOUND if value < 1.7 else DIVERGED, bisected=True), lambda c: c.is_sound
        )
        assert bracket.low.y < 1.7 <= bracket.high.y
    assert bracket.high.y - bracket.low.y < 1e-4


def test_a_bracket_ends_where_nothing_can_be_run() -> None:
    bracket = Bracket(Cell("a", 1.0, SOUND), Cell("a", 2.0, DIVERGED))
    for cell in (None, Cell("a", 1.5, NOT_RUN)):
        closed = bracket.halved(cell, lambda each: each.is_sound)
        assert (closed.low, closed.high) == (bracket.low, bracket.high)
        assert middle(_Y, closed) is None
    # And where two values are the same in the digits that are told.
    assert middle(_Y, Bracket(Cell("a", 1.0, SOUND), Cell("a", 1.000001, DIVERGED))) is None
