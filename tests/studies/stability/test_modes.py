"""If these fail, a map draws a linear system's boundary where rounding, and not growth, decided."""

from collections.abc import Sequence

import numpy as np
import pytest
from cardiac_cosim.orchestrator.participants.participant import Values
from cardiac_cosim.studies.stability.modes import fitted_modes
from oscillator import Oscillator

_MILD = Oscillator()
_STIFF = Oscillator((10.0, 1000.0, 100.0), (1.0, 10.0, 5.0))
#: Hardly damped: over a step of a tenth of a millisecond |z| is 1 − 10⁻⁶ or nearer.
_FREE = Oscillator((10.0, 1000.0, 100.0), (0.01, 0.01, 0.01))

#: Displacements, velocities and the force, as the oscillator's time series has them; what it had before, it lacks.
_SHOWN = (0, 1, 2, 3, 4)


def _columns(matrix: Values, start: Values, count: int, shown: Sequence[int], rest: float = 0.0) -> dict[str, Values]:
    rows, state = [], start
    with np.errstate(all="ignore"):
        for _ in range(count):
            rows.append(state[list(shown)] + rest)
            state = matrix @ state
    table = np.array(rows)
    return {"time_ms": np.arange(count) * 0.1, **{f"c{place}": column for place, column in enumerate(table.T)}}


def _run(oscillator: Oscillator, split: str, scheme: str, order: int, size: float) -> tuple[Values, Values, float]:
    matrix = oscillator.amplification(split, scheme, order, size)
    start = np.array(oscillator.start)
    force = oscillator.bodies(split)[1].load(start[2:] - start[:2])
    return matrix, np.array([*start, force, *start, force]), float(np.abs(np.linalg.eigvals(matrix)).max())


@pytest.mark.parametrize("oscillator", [_MILD, _STIFF, _FREE], ids=["mild", "stiff", "free"])
@pytest.mark.parametrize("split", ["FD", "DD"])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("shown", [_SHOWN, _SHOWN[:4]], ids=["force", "no force"])
def test_the_radius_is_that_of_the_exact_matrix(
    oscillator: Oscillator, split: str, scheme: str, order: int, shown: Sequence[int]
) -> None:
    for size in (1e-4, 1e-3, 1e-2, 0.0777, 0.2, 0.3, 1.0):
        matrix, start, radius = _run(oscillator, split, scheme, order, size)
        modes = fitted_modes(_columns(matrix, start, 300, shown))
        assert modes.radius == pytest.approx(radius, rel=1e-8), size
        assert modes.grows == (radius > 1.0), size


@pytest.mark.parametrize("away", [-2e-6, -4e-8, 4e-8, 2e-6])
def test_which_side_of_one_a_slow_mode_is_on_is_right_to_some_parts_in_a_hundred_million(away: float) -> None:
    turn = 3e-4
    block = (1.0 + away) * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    matrix = np.diag([0.0, 0.0, 0.3, -0.8])
    matrix[:2, :2] = block
    modes = fitted_modes(_columns(matrix, np.ones(4), 200, range(4)))
    assert modes.radius == pytest.approx(1.0 + away, abs=1e-10)
    assert modes.grows == (away > 0.0)


def test_fast_modes_that_are_gone_soon_disturb_nothing() -> None:
    matrix = np.array([[1.01, 0.5, 0.2], [0.0, 1e-3, 0.1], [0.0, 0.0, -0.2]])
    assert fitted_modes(_columns(matrix, np.ones(3), 60, range(3))).radius == pytest.approx(1.01, rel=1e-10)
    matrix[0, 0] = 0.99
    assert fitted_modes(_columns(matrix, np.ones(3), 60, range(3))).radius == pytest.approx(0.99, rel=1e-10)


@pytest.mark.parametrize("factor", [-1e2, -1e4])
def test_growth_to_the_end_of_the_numbers_is_growth(factor: float) -> None:
    matrix = np.array([[factor, 1.0], [0.0, 0.9]])
    columns = _columns(matrix, np.ones(2), int(400 / np.log10(-factor)), range(2))
    assert not np.isfinite(columns["c0"]).all()
    modes = fitted_modes(columns)
    assert modes.radius == pytest.approx(-factor, rel=1e-8)
    assert (modes.grows, modes.alternates) == (True, True)


def test_decay_to_nothing_is_decay() -> None:
    columns = _columns(np.array([[0.01, 1.0], [0.0, 0.02]]), np.ones(2), 400, range(2))
    assert columns["c0"][-1] == 0.0
    assert fitted_modes(columns).radius == pytest.approx(0.02, rel=1e-6)


@pytest.mark.parametrize("factor", [-0.98, -1.02, 0.98, 1.02])
def test_a_rest_position_is_no_mode(factor: float) -> None:
    matrix = np.array([[factor, 0.3], [0.0, 0.5]])
    modes = fitted_modes(_columns(matrix, np.ones(2), 80, range(2), rest=0.7))
    assert modes.radius == pytest.approx(abs(factor), rel=1e-8)
    assert modes.grows == (abs(factor) > 1.0)
    assert modes.alternates == (factor < 0.0)


def test_a_run_too_short_to_tell_is_not_said_to_grow() -> None:
    # Six milliseconds of a motion of seconds, about a rest position: all that is seen is a line.
    for scheme in ("jacobi", "gauss-seidel"):
        for order in (0, 1):
            matrix, start, radius = _run(_MILD, "FD", scheme, order, 1e-4)
            assert radius < 1.0
            assert not fitted_modes(_columns(matrix, start, 60, _SHOWN[:4], rest=0.3)).grows


def test_what_shows_one_value_only_is_seen_with_those_before_it() -> None:
    # z² = −1.1: Jacobi of two units that answer at once.
    matrix = np.array([[0.0, 1.1], [-1.0, 0.0]])
    modes = fitted_modes(_columns(matrix, np.array([1.0, 0.3]), 60, [0]))
    assert modes.radius == pytest.approx(np.sqrt(1.1), rel=1e-10)
    assert modes.angle_deg == pytest.approx(90.0)


def test_what_has_no_modes_says_why() -> None:
    time = np.arange(60.0)
    logistic = [0.3]
    for _ in time[1:]:
        logistic.append(3.9 * logistic[-1] * (1.0 - logistic[-1]))
    for columns, why in (
        ({"time_ms": time, "a": np.ones(60)}, "nothing in its time series moves"),
        ({"time_ms": time[:4], "a": time[:4] ** 2}, "too short"),
        ({"time_ms": time**2, "a": 0.9**time}, "steps differ"),
        ({"time_ms": time, "a": np.array(logistic)}, "not a linear recurrence"),
    ):
        modes = fitted_modes(columns)
        assert modes.radius is None
        assert why in modes.why
        assert not modes.grows


def test_values_that_pass_through_zero_exactly_are_fitted_as_well() -> None:
    # The limit case itself: 2, 0, 2, 0 rings for ever.
    time = np.arange(60.0)
    modes = fitted_modes({"time_ms": time, "a": 1.0 + (-1.0) ** time, "b": -1.0 - (-1.0) ** time})
    assert modes.radius == pytest.approx(1.0, abs=1e-9)
    assert not modes.grows
