"""If these fail, an error bar is drawn that the values do not bear out, or one that they do is refused."""

from math import inf, isnan, nan

import pytest
from cardiac_cosim.studies.budget.richardson import Estimate, richardson


def _values(law: object, levels: tuple[int, ...], ratio: float = 2.0) -> dict[int, float]:
    assert callable(law)
    return {level: law(ratio**-level) for level in levels}


def _estimate(law: object, levels: tuple[int, ...], ratio: float = 2.0, highest: float = 3.0) -> Estimate:
    return richardson(_values(law, levels, ratio), ratio, highest)


@pytest.mark.parametrize("levels", [(-1, 0, 1), (0, 1, 2), (-1, 0, 1, 2)])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("size", [3.0, -0.02])
def test_a_pure_power_is_found_exactly(order: int, size: float, levels: tuple[int, ...]) -> None:
    found = _estimate(lambda h: 107.0 + size * h**order, levels)
    assert found.trusted
    assert found.order == pytest.approx(order)
    assert found.error == pytest.approx(size)
    assert found.is_settled


def test_a_tolerance_has_its_order_in_the_tolerance() -> None:
    found = _estimate(lambda tolerance: 5.0 + 0.1 * tolerance, (-1, 0, 1, 2), 4.0, 1.5)
    assert found.trusted
    assert found.order == pytest.approx(1.0)
    assert found.error == pytest.approx(0.1)
    # An order of 2 in the tolerance is that of nothing.
    assert not _estimate(lambda tolerance: 5.0 + 0.1 * tolerance**2, (-1, 0, 1, 2), 4.0, 1.5).trusted


def test_an_unusual_order_is_believed_only_if_four_runs_show_it() -> None:
    def law(h: float) -> float:
        return 1.0 + h**0.6

    confirmed = _estimate(law, (-1, 0, 1, 2))
    assert confirmed.trusted
    assert confirmed.error == pytest.approx(1.0)
    for levels, why in (((0, 1, 2), "no coarser run"), ((-1, 0, 1), "no finer run")):
        refused = _estimate(law, levels)
        assert not refused.trusted
        assert why in refused.reason
        assert refused.order == pytest.approx(0.6)
    # On either side of what three runs may show.
    assert _estimate(lambda h: 1.0 + h**0.76, (0, 1, 2)).trusted
    assert not _estimate(lambda h: 1.0 + h**0.74, (0, 1, 2)).trusted
    assert _estimate(lambda h: 1.0 + h**1.24, (-1, 0, 1)).trusted
    assert not _estimate(lambda h: 1.0 + h**1.26, (-1, 0, 1)).trusted


def test_beyond_the_orders_of_methods_nothing_is_believed() -> None:
    for order, trusted in ((0.51, True), (0.49, False), (2.99, True), (3.01, False)):
        found = _estimate(lambda h, order=order: 1.0 + h**order, (-1, 0, 1, 2))
        assert found.trusted is trusted, order
        assert found.order == pytest.approx(order)
    assert "hardly shrink" in _estimate(lambda h: 1.0 + h**0.49, (0, 1, 2)).reason
    assert "is chance" in _estimate(lambda h: 1.0 + h**3.01, (0, 1, 2)).reason


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({0: 1.0, 1: 1.2, 2: 1.1}, "back and forth"),
        ({-1: 1.1, 0: 1.0, 1: 1.2}, "back and forth"),
        ({0: 1.0, 1: 1.1, 2: 1.2}, "hardly shrink"),
        ({0: 1.0, 1: 1.1, 2: 1.3}, "do not shrink"),
        ({0: 1.0, 1: 1.1, 2: 1.1}, "fall to round-off"),
        ({0: 1.0, 1: 1.1}, "two runs"),
        # The finer three say 0.2, the coarser ones have no order, or say something else.
        ({-1: 1.0, 0: 1.0, 1: 0.9, 2: 0.85}, "the coarser run shows no order"),
        ({-1: 1.11, 0: 1.0, 1: 0.9, 2: 0.85}, "the coarser runs give"),
    ],
)
def test_outside_the_asymptotic_range_only_the_difference_to_the_finest_run_is_told(
    values: dict[int, float], why: str
) -> None:
    found = richardson(values, 2.0, 3.0)
    assert not found.trusted
    assert not found.is_settled
    assert why in found.reason
    assert found.error == values[0] - values[max(values)]


def test_triplets_may_differ_by_half_but_not_by_more() -> None:
    # The finer differences 0.1 and 0.05 say 0.2; the coarser ones 0.1 / (1 - 0.1 / d).
    for said, trusted in ((0.29, True), (0.31, False), (0.14, True), (0.132, False)):
        before = 0.1 / (1.0 - 0.1 / said)
        found = richardson({-1: 1.0 + before, 0: 1.0, 1: 0.9, 2: 0.85}, 2.0, 3.0)
        assert found.trusted is trusted, said


def test_what_is_round_off_is_negligible_and_needs_no_finer_run() -> None:
    for values in ({0: 0.0, 1: 0.0}, {-1: 3.0, 0: 100.0, 1: 100.0}, {0: 100.0, 1: 100.0 + 1e-8, 2: 100.0 - 1e-8}):
        found = richardson(values, 2.0, 3.0)
        assert not found.trusted
        assert found.negligible
        assert found.is_settled
        assert found.reason.startswith("negligible: below")
    # Ten times as much is a difference.
    assert not richardson({0: 100.0, 1: 100.0 + 1e-6}, 2.0, 3.0).negligible


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_value_that_is_no_number_has_no_error_bar(bad: float) -> None:
    found = richardson({0: 1.0, 1: bad, 2: 1.0}, 2.0, 3.0)
    assert not found.trusted
    assert isnan(found.error)


def test_what_is_trusted_is_within_a_factor_of_two_of_the_difference_to_the_fourfold_run() -> None:
    # Two powers that compete, of any sizes: many sequences outside their asymptotic range are among them.
    trusted = 0
    for one in range(-20, 21):
        for other in range(-20, 21):
            values = _values(lambda h, a=one, b=other: 10.0 + a * h + b * h**2, (-1, 0, 1, 2))
            found = richardson(values, 2.0, 3.0)
            coarse = richardson({level: values[level] for level in (-1, 0, 1)}, 2.0, 3.0)
            for estimate in (found, coarse):
                if estimate.trusted:
                    trusted += 1
                    assert 0.5 <= estimate.error / (values[0] - values[2]) <= 2.0, (one, other)
    assert trusted > 400
