"""If these fail, a map of stability draws its boundary where no run ever fails."""

import numpy as np
import pytest
from cardiac_cosim.units.stability.recurrence import amplification, stabilised


def _measured(gain: float, jacobi: bool, order: int, share: float = 0.0, steps: int = 400) -> float:
    """Growth per step of the two units y = K x and x = (g/K)(y − w K x₀) + w g x by themselves, here with K = 1.

    x₀ is what the first unit has seen.
    """

    def ahead(values: list[float]) -> float:
        newest = values[: -order - 2 : -1]
        weights = {0: [1.0], 1: [2.0, -1.0], 2: [3.0, -3.0, 1.0]}[order]
        return float(np.dot(weights, newest))

    random = np.random.default_rng(1)
    courses = x, y, seen = tuple(list(random.standard_normal(4)) for _ in range(3))
    logarithm = 0.0
    for number in range(steps):
        given = ahead(x)
        stress, reference = (ahead(y), ahead(seen)) if jacobi else (given, given)
        x.append(gain * (stress - share * reference) / (1.0 - share * gain))
        y.append(given)
        seen.append(given)
        # It is linear: made small or large again, nothing under- or overflows.
        size = max(abs(value) for course in courses for value in course[-8:])
        for course in courses:
            course[:] = [value / size for value in course[-8:]]
        logarithm += np.log(size) if number >= steps // 2 else 0.0
    return float(np.exp(logarithm / (steps - steps // 2)))


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("jacobi", [False, True], ids=["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("gain", [-1.2, -0.9, -0.3, 0.6])
def test_errors_grow_as_the_recurrence_itself(gain: float, jacobi: bool, order: int) -> None:
    assert amplification(gain, jacobi, order) == pytest.approx(_measured(gain, jacobi, order), rel=0.02)


@pytest.mark.parametrize("share", [0.3, 0.8, 1.5])
@pytest.mark.parametrize("jacobi", [False, True], ids=["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("order", [0, 1])
def test_what_a_stabilised_unit_gives_back(order: int, jacobi: bool, share: float) -> None:
    gain = -1.4
    found = amplification(stabilised(gain, share), jacobi, order)
    assert found == pytest.approx(_measured(gain, jacobi, order, share), rel=0.02)


def test_closed_forms() -> None:
    # Held inputs: an error comes back as g times itself; extrapolated to first order, the roots of z² = g (2 z − 1).
    assert amplification(-0.5, False, 0) == pytest.approx(0.5)
    assert amplification(-0.25, True, 0) == pytest.approx(0.5)
    assert amplification(-1.0, False, 1) == pytest.approx(1.0 + np.sqrt(2.0))
    # Which is 1 at g = −1/3: extrapolation has its price.
    assert amplification(-1.0 / 3.0, False, 1) == pytest.approx(1.0)
    assert amplification(0.0, False, 0) == amplification(0.0, True, 2) == 0.0


@pytest.mark.parametrize("gain", [-0.5, -1.0, -30.0, 0.4])
def test_all_of_the_stiffness_leaves_nothing(gain: float) -> None:
    assert stabilised(gain, 1.0) == 0.0
    assert stabilised(gain, 0.0) == gain


def test_the_share_that_is_needed() -> None:
    # |g (1 − w)/(1 − w g)| = 1 at w = (1 + g)/(2 g).
    gain = -3.0
    least = (1.0 + gain) / (2.0 * gain)
    assert abs(stabilised(gain, least - 0.01)) > 1.0 > abs(stabilised(gain, least + 0.01))


def test_a_unit_that_its_stabilisation_leaves_without_stiffness_is_unstable() -> None:
    assert amplification(stabilised(2.0, 0.5), False, 0) == np.inf
