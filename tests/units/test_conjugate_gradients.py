"""If these fail, a potential passes for the solution of an equation that it does not solve."""

import numpy as np
import pytest
from cardiac_cosim.units.conjugate_gradients import conjugate_gradients
from scipy.sparse import csr_matrix, diags_array


def _system(size: int = 40) -> csr_matrix:
    side = -np.ones(size - 1)
    return csr_matrix(diags_array([side, np.linspace(2.1, 50.0, size), side], offsets=[-1, 0, 1]))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-9])
def test_residual_is_below_the_tolerance(tolerance: float) -> None:
    system = _system()
    right, guess = np.random.default_rng(1).normal(size=(2, 40))
    solution = conjugate_gradients(system, right, guess, tolerance, 100)
    assert solution is not None
    left = np.linalg.norm(right - system @ solution) / np.linalg.norm(right)
    assert 1e-3 * tolerance < left <= 1.001 * tolerance


def test_too_few_iterations_and_numbers_that_are_none_are_no_solution() -> None:
    system, right = _system(), np.ones(40)
    assert conjugate_gradients(system, right, np.zeros(40), 1e-12, 5) is None
    assert conjugate_gradients(system, right, np.zeros(40), 1e-12, 100) is not None
    right[3] = np.nan
    assert conjugate_gradients(system, right, np.zeros(40), 1e-12, 100) is None


def test_nothing_on_the_right_is_nothing_to_the_bit() -> None:
    solution = conjugate_gradients(_system(), np.zeros(40), np.full(40, 1e-3), 1e-9, 100)
    assert solution is not None
    assert (solution == 0.0).all()
