"""If these fail, the line that theory draws over a map lies beside its own limit, or is missing where there is one."""

from collections.abc import Callable
from math import exp, hypot, inf

import pytest
from cardiac_cosim.studies.stability.axis import Axis
from cardiac_cosim.studies.stability.limit import Limit, nearest

_LINEAR = Axis("x", [0.0, 1.0, 2.0, 4.0])
_LOG = Axis("y", [0.1, 1.0, 10.0, 100.0])


def _limit(x: Axis, y: Axis, amplification: Callable[[float, float], float | None], costly: bool = False) -> Limit:
    return Limit(x, y, amplification, costly)


def test_every_corner_of_the_curve_is_on_the_limit() -> None:
    (curve,) = _limit(_LINEAR, _LOG, lambda x, y: y / exp(x)).curves()
    for x, y in curve:
        assert y == pytest.approx(exp(x), rel=1e-7)
    xs = sorted(x for x, _ in curve)
    assert (xs[0], xs[-1]) == (0.0, 4.0)
    # Two more places between those of the grid at least.
    assert {1.0, 2.0} < set(xs)
    assert len(curve) >= 10


def test_a_limit_that_does_not_depend_on_y_is_a_line_along_y() -> None:
    (curve,) = _limit(_LINEAR, _LOG, lambda x, y: abs(x - 0.4)).curves()
    assert all(x == pytest.approx(1.4, rel=1e-7) for x, _ in curve)
    assert sorted(y for _, y in curve)[:: len(curve) - 1] == [0.1, 100.0]


def test_a_closed_region_has_a_closed_curve() -> None:
    box = Axis("x", [-2.0, -1.0, 0.0, 1.0, 2.0])
    (curve,) = _limit(box, Axis("y", box.values), lambda x, y: hypot(x, y) / 1.2).curves()
    assert curve[0] == curve[-1]
    assert all(hypot(x, y) == pytest.approx(1.2, rel=1e-7) for x, y in curve)


def test_two_limits_are_two_pieces() -> None:
    curves = _limit(_LINEAR, Axis("y", [0.0, 1.0, 2.0]), lambda x, y: 0.5 if 0.31 < y < 1.3 else 2.0).curves()
    assert sorted(round(piece[0][1], 6) for piece in curves) == [0.31, 1.3]


def test_where_nothing_is_predicted_there_is_no_curve() -> None:
    (curve,) = _limit(_LINEAR, _LOG, lambda x, y: None if x > 2.0 else y / 3.0).curves()
    assert max(x for x, _ in curve) == 2.0
    assert _limit(_LINEAR, _LOG, lambda x, y: None).curves() == []
    assert _limit(_LINEAR, _LOG, lambda x, y: 0.5).curves() == []
    assert _limit(_LINEAR, Axis("y", [1.0]), lambda x, y: y).curves() == []


def test_what_neither_grows_nor_decays_is_no_limit() -> None:
    assert _limit(_LINEAR, _LOG, lambda x, y: 1.0 + (1e-13 if int(7 * y) % 2 else -1e-13)).curves() == []
    (curve,) = _limit(_LINEAR, _LOG, lambda x, y: 1.0 if y < 5.0 else 1.1).curves()
    assert all(y == pytest.approx(5.0, rel=1e-6) for _, y in curve)


def test_no_amplification_is_too_large_or_too_small() -> None:
    (curve,) = _limit(_LINEAR, _LOG, lambda x, y: 0.0 if y < 5.0 else inf).curves()
    assert all(y == pytest.approx(5.0, rel=1e-6) for _, y in curve)


def test_all_limits_at_a_value_of_x_are_found() -> None:
    found = _limit(_LINEAR, _LOG, lambda x, y: 2.0 if 0.5 < y < 20.0 else 0.5).at(1.0)
    assert found == pytest.approx([0.5, 20.0], rel=1e-6)
    assert nearest(_LOG, found, 4.0) == found[1]
    # The same differences as on the logarithmic axis, and the other one is the nearer.
    assert nearest(Axis("y", [0.0, 20.0]), found, 4.0) == found[0]
    assert nearest(_LOG, [], 4.0) is None
    categorical = Axis("x", ["a", "b"])
    assert Limit(categorical, _LOG, lambda x, y: y / 3.0 if x == "a" else 0.1, False).at("a") == pytest.approx([3.0])
    assert Limit(categorical, _LOG, lambda x, y: y / 3.0 if x == "a" else 0.1, False).at("b") == []


def test_a_costly_theory_is_asked_at_the_values_of_the_study() -> None:
    asked = []

    def amplification(x: float, y: float) -> float:
        asked.append((x, y))
        return y / exp(x)

    (curve,) = _limit(_LINEAR, _LOG, amplification, costly=True).curves()
    assert all(y == pytest.approx(exp(x), rel=1e-2) for x, y in curve)
    assert {(x, y) for x in _LINEAR.values for y in _LOG.values} <= set(asked)
    assert len(set(asked)) < 16 + 12 * len(curve)


def test_between_whole_numbers_the_limit_is_drawn_on_a_line() -> None:
    def amplification(x: float, y: float) -> float | None:
        return exp(y - 1.3) if y == round(y) else None

    curves = _limit(_LINEAR, Axis("y", [0, 1, 2, 3]), amplification, costly=True).curves()
    assert all(y == pytest.approx(1.3) for curve in curves for _, y in curve)
    assert len(curves) == 1
    assert _limit(_LINEAR, Axis("y", [0, 1, 2, 3]), amplification, costly=True).at(1.0) == pytest.approx([1.3])
