"""Sparse LU factors by SciPy's SuperLU: everywhere, and several times slower than supernodal factors."""

import numpy as np
import scipy
from scipy.sparse.linalg import splu

from ..stiffness import Stiffness
from .factorisation import NotFactorised, Solve


class SuperLU:
    """See Factorisation. That a stiffness is not positive definite shows in its solutions only."""

    name = f"SuperLU factors (SciPy {scipy.__version__})"

    def __call__(self, matrix: Stiffness) -> Solve:
        """See Factorisation."""
        full = matrix.full()
        if not np.isfinite(full.data).all():
            raise NotFactorised("the tangent stiffness holds numbers that are not finite")
        try:
            # The tangent is symmetric: diagonal pivots and an ordering of A + Aᵀ halve time and fill.
            factors = splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        # What SuperLU says of a zero pivot.
        except RuntimeError as error:
            raise NotFactorised(f"the tangent stiffness cannot be factorised ({error})") from None
        return factors.solve
