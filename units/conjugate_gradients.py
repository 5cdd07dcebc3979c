"""Preconditioned conjugate gradients in NumPy.

SciPy's take their inner products from BLAS, whose bits depend on the number of threads: a unit would compute other bits
in a worker process than in the master.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import sparray, spmatrix

from .arrays import FloatArray, inner


def conjugate_gradients(
    matrix: spmatrix | sparray,
    right: FloatArray,
    guess: FloatArray,
    tolerance: float,
    most: int,
    precondition: Callable[[FloatArray], FloatArray] | None = None,
) -> FloatArray | None:
    """The solution of a symmetric positive definite system, from a guess; None where `most` iterations do not reach it.

    The residual is then `tolerance` times as large as the right-hand side, shape (n,). Without `precondition`, which
    takes residuals to steps, the diagonal does that.
    """
    limit = tolerance**2 * inner(right, right)
    if limit == 0.0:
        return np.zeros_like(right)
    if precondition is None:
        inverse = 1.0 / matrix.diagonal()

        def precondition(residual: FloatArray) -> FloatArray:
            return inverse * residual

    solution, residual = np.array(guess), right - matrix @ guess
    direction = precondition(residual)
    squared = inner(residual, direction)
    for iteration in range(most):
        left = inner(residual, residual)
        # A guess is improved once at least, so that a solution does not hang on whether it has just met the tolerance.
        if left <= limit and (iteration or left == 0.0):
            return solution
        image = matrix @ direction
        stiffness = inner(direction, image)
        # Not finite, or not positive definite.
        if not stiffness > 0.0:
            return None
        step = squared / stiffness
        solution += step * direction
        residual -= step * image
        preconditioned = precondition(residual)
        before, squared = squared, inner(residual, preconditioned)
        direction = preconditioned + squared / before * direction
    return None
