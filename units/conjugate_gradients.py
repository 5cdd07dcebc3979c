"""Conjugate gradients preconditioned by the diagonal, in NumPy.

SciPy's take their inner products from BLAS, whose bits depend on the number of threads: a unit would compute other bits
in a worker process than in the master.
"""

import numpy as np
from scipy.sparse import csr_matrix

from .arrays import FloatArray, inner


def conjugate_gradients(
    matrix: csr_matrix, right: FloatArray, guess: FloatArray, tolerance: float, most: int
) -> FloatArray | None:
    """The solution of a symmetric positive definite system, from a guess; None where `most` iterations do not reach it.

    The residual is then `tolerance` times as large as the right-hand side, shape (n,).
    """
    limit = tolerance**2 * inner(right, right)
    if limit == 0.0:
        return np.zeros_like(right)
    inverse = 1.0 / matrix.diagonal()
    solution, residual = np.array(guess), right - matrix @ guess
    direction = inverse * residual
    squared = inner(residual, direction)
    for _ in range(most):
        if inner(residual, residual) <= limit:
            return solution
        image = matrix @ direction
        stiffness = inner(direction, image)
        # Not finite, or not positive definite.
        if not stiffness > 0.0:
            return None
        step = squared / stiffness
        solution += step * direction
        residual -= step * image
        preconditioned = inverse * residual
        before, squared = squared, inner(residual, preconditioned)
        direction = preconditioned + squared / before * direction
    return None
