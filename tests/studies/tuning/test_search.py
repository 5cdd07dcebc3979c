"""If these fail, tuning recommends a setting although a cheaper one that it knew of keeps the tolerances too."""

from collections.abc import Sequence
from itertools import product

import pytest
from cardiac_cosim.studies.tuning.search import NOISE, Candidate, Outcome, Search
from hypothesis import given
from hypothesis import strategies as st


def _run(search: Search, table: Sequence[Outcome | None], at_once: int = 1) -> list[int]:
    """Answer all that the search asks for from a table; the order in which it asked."""
    asked = []
    while places := search.next(at_once):
        assert len(places) <= at_once
        for place in places:
            asked.append(place)
            search.tell(place, table[place])
    return asked


def _outcome(cost_s: float, worst: float) -> Outcome:
    return Outcome(cost_s, worst, cost_s)


def _line(name: str, count: int) -> list[Candidate]:
    return [Candidate(f"{name} {place}", name, {"step": float(place)}) for place in range(count)]


_ERRORS = st.floats(0.0, 5.0)

#: Of each line the increments of its cost from point to point, and the worst error of each point.
_LINES = st.lists(st.lists(st.tuples(st.floats(0.0, 3.0), _ERRORS), min_size=1, max_size=6), min_size=1, max_size=6)


@given(_LINES, st.integers(1, 3))
def test_the_winner_is_that_of_an_exhaustive_search(lines: list[list[tuple[float, float]]], at_once: int) -> None:
    candidates, table = [], []
    for number, line in enumerate(lines):
        candidates += _line(f"line {number}", len(line))
        cost = 0.1
        for more, worst in line:
            cost += more
            table.append(_outcome(cost, worst))
    search = Search(candidates)
    asked = _run(search, table, at_once)
    meeting = [outcome.cost_s for outcome in table if outcome.meets]
    assert (search.best is None) == (not meeting)
    if search.best is not None:
        assert table[search.best].cost_s == min(meeting)
    # Every candidate was run once, or has a reason.
    assert sorted([*asked, *search.pruned]) == list(range(len(candidates)))


@given(st.lists(st.floats(0.0, 2.0), min_size=9, max_size=9), st.lists(_ERRORS, min_size=9, max_size=9))
def test_the_winner_is_that_of_an_exhaustive_search_of_a_product(more: list[float], errors: list[float]) -> None:
    # Two keys at three values each: a point costs at least what those that are coarser in both do.
    places = list(product(range(3), repeat=2))
    candidates = [Candidate(f"{place}", "group", {"step": place[0], "inside": place[1]}) for place in places]
    costs = [
        0.1 + sum(extra for extra, other in zip(more, places, strict=True) if other[0] <= own[0] and other[1] <= own[1])
        for own in places
    ]
    table = [_outcome(cost, error) for cost, error in zip(costs, errors, strict=True)]
    search = Search(candidates)
    _run(search, table)
    meeting = [outcome.cost_s for outcome in table if outcome.meets]
    assert (search.best is None) == (not meeting)
    if search.best is not None:
        assert table[search.best].cost_s == min(meeting)


@given(
    st.lists(
        st.tuples(st.lists(st.floats(0.0, 3.0), max_size=3), st.lists(st.floats(0.0, 3.0), max_size=3), _ERRORS),
        min_size=1,
        max_size=5,
    ),
    st.lists(_ERRORS, min_size=35, max_size=35),
)
def test_the_winner_is_found_where_long_steps_cost_more_than_shorter_ones(
    lines: list[tuple[list[float], list[float], float]], errors: list[float]
) -> None:
    # Along the communication steps the costs fall first, and then rise.
    candidates, table = [], []
    for number, (falling, rising, _) in enumerate(lines):
        costs = [1.0 + sum(falling[place:]) for place in range(len(falling) + 1)]
        costs += [1.0 + sum(rising[: place + 1]) for place in range(len(rising))]
        candidates += [Candidate(f"{number} {at}", number, {"coupling": float(at)}) for at in range(len(costs))]
        table += [_outcome(cost, errors[7 * number + at]) for at, cost in enumerate(costs)]
    search = Search(candidates)
    _run(search, table)
    meeting = [outcome.cost_s for outcome in table if outcome.meets]
    assert (search.best is None) == (not meeting)
    if search.best is not None:
        assert table[search.best].cost_s == min(meeting)


def test_along_the_coupling_the_cost_has_to_rise_before_the_rest_is_left_out() -> None:
    line = [Candidate(f"jacobi {at}", "jacobi", {"coupling": float(at), "inside": 1.0}) for at in range(5)]
    table = [_outcome(3.0, 0.9), _outcome(2.0, 0.5), _outcome(1.0, 0.4), _outcome(1.5, 0.3), _outcome(2.5, 0.2)]
    search = Search(line)
    assert _run(search, table) == [0, 1, 2, 3]
    assert search.best == 2
    # That it rises there holds for all that compute otherwise inside as well.
    rough = Candidate("rough", "jacobi", {"coupling": 2.0, "inside": 0.0}, 1)
    finer = Candidate("rough and finer", "jacobi", {"coupling": 3.0, "inside": 0.0}, 1)
    search = Search([*line, rough, finer])
    assert _run(search, [*table, _outcome(0.8, 0.7), _outcome(1.2, 0.6)]) == [0, 1, 2, 3, 5]
    assert search.best == 5


def test_what_is_finer_than_a_good_enough_point_is_not_run() -> None:
    search = Search(_line("held", 4))
    asked = _run(search, [_outcome(1.0, 2.0), _outcome(2.0, 0.9), _outcome(3.0, 0.1), _outcome(4.0, 0.0)])
    assert asked == [0, 1]
    assert set(search.pruned) == {2, 3}
    assert "held 1" in search.pruned[2]


def test_what_is_finer_than_a_point_that_costs_more_than_the_best_is_not_run() -> None:
    search = Search([*_line("held", 1), *_line("iterated", 3)])
    table = [_outcome(1.0, 0.5), _outcome(1.0 + 2.0 * NOISE, 3.0), _outcome(5.0, 0.1), _outcome(9.0, 0.0)]
    assert _run(search, table) == [0, 1]
    assert "costs 1.2 s (iterated 0)" in search.pruned[2]


def test_costs_that_differ_by_noise_prune_nothing() -> None:
    search = Search([*_line("held", 1), *_line("iterated", 2)])
    table = [_outcome(1.0, 0.5), _outcome(1.0 + 0.5 * NOISE, 3.0), _outcome(0.99, 0.1)]
    assert _run(search, table) == [0, 1, 2]
    assert search.best == 2


def test_a_cost_that_a_busy_machine_raised_prunes_nothing() -> None:
    search = Search([*_line("held", 1), *_line("iterated", 2)])
    assert _run(search, [_outcome(1.0, 0.5), Outcome(3.0, 3.0, 0.8), _outcome(0.9, 0.1)]) == [0, 1, 2]
    assert search.best == 2


def test_the_line_that_may_be_cheapest_goes_on_first() -> None:
    search = Search([*_line("dear", 2), *_line("cheap", 2)])
    table = [_outcome(5.0, 2.0), _outcome(6.0, 0.5), _outcome(1.0, 2.0), _outcome(2.0, 0.5)]
    assert _run(search, table) == [0, 2, 3]


def test_those_that_follow_a_hopeless_lead_are_not_run_and_those_of_a_near_miss_are() -> None:
    lead = Candidate("lead", "held", {"step": 0.0, "inside": 1.0})
    follower = Candidate("follower", "held", {"step": 0.0, "inside": 0.0}, 1, ("lead",))
    search = Search([lead, follower])
    assert _run(search, [_outcome(1.0, 10.0), _outcome(0.5, 0.5)]) == [0]
    assert "factor of 10" in search.pruned[1]
    search = Search([lead, follower])
    assert _run(search, [_outcome(1.0, 1.2), _outcome(0.5, 0.5)]) == [0, 1]
    assert search.best == 1


@pytest.mark.parametrize("failing", [0, 1])
def test_a_point_without_results_says_nothing_of_others(failing: int) -> None:
    table: list[Outcome | None] = [_outcome(1.0, 2.0), _outcome(2.0, 2.0), _outcome(3.0, 0.5)]
    table[failing] = None
    search = Search(_line("held", 3))
    assert _run(search, table) == [0, 1, 2]
    assert search.best == 2


def test_nothing_meets_and_the_nearest_is_told() -> None:
    search = Search([*_line("held", 2), *_line("iterated", 1)])
    _run(search, [_outcome(1.0, 4.0), _outcome(2.0, 1.5), _outcome(3.0, 2.0)])
    assert search.best is None
    assert search.nearest() == 1
    assert search.finalists(0.1, 3) == []


def test_finalists_are_those_that_may_be_as_cheap_as_the_best() -> None:
    search = Search([Candidate(name, name) for name in "abcd"])
    _run(search, [_outcome(1.0, 0.5), _outcome(1.04, 0.9), Outcome(1.5, 0.5, 1.01), _outcome(1.5, 0.1)])
    assert search.finalists(0.05, 9) == [0, 1, 2]
    assert search.finalists(0.05, 2) == [0, 1]


def test_what_was_pruned_is_judged_again_when_the_best_turns_out_to_cost_more() -> None:
    search = Search([*_line("held", 1), *_line("iterated", 2)])
    table = [_outcome(1.0, 0.5), _outcome(1.5, 3.0), _outcome(1.6, 0.1)]
    assert _run(search, table) == [0, 1]
    search.tell(0, Outcome(2.0, 0.5, 0.9))
    search.reconsider()
    assert _run(search, table) == [2]
    assert search.best == 2
