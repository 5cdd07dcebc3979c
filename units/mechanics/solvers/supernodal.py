"""Supernodal LDLᵀ factors by rslab, in single precision: half the memory, and as good as a preconditioner.

The pattern is analysed once. One thread: the units of a scene may run side by side.
"""

from typing import Any

import numpy as np

from ...arrays import FloatArray
from ..stiffness import Stiffness
from .factorisation import NotFactorised, Solve


class Supernodal:
    """See Factorisation. ImportError where rslab is not installed."""

    def __init__(self) -> None:
        import rslab

        self.name = f"supernodal factors (rslab {rslab.__version__})"
        self._analyse = rslab.analyze
        self._analysis: Any = None

    def __call__(self, matrix: Stiffness) -> Solve:
        """See Factorisation."""
        lower = matrix.lower()
        if not np.isfinite(lower.data).all():
            raise NotFactorised("the tangent stiffness holds numbers that are not finite")
        if self._analysis is None:
            self._analysis = self._analyse(lower, path="ldlt", threads=1)
        try:
            return self._factored(lower.data, np.float32)
        except NotFactorised:
            # A stiffness may be too badly conditioned for single precision, of nearly incompressible tissue say.
            return self._factored(lower.data, np.float64)

    def _factored(self, values: FloatArray, precision: type) -> Solve:
        try:
            with np.errstate(over="ignore"):
                factor = self._analysis.factor(values.astype(precision))
        # What rslab says of a zero pivot, and of numbers that left the range of single precision.
        except (RuntimeError, ValueError) as error:
            raise NotFactorised(f"the tangent stiffness cannot be factorised ({error})") from None
        if factor.inertia[0] != self._analysis.n:
            raise NotFactorised("the tangent stiffness is not positive definite: the solid is unstable there")

        def solve(right: FloatArray) -> FloatArray:
            return np.asarray(factor.solve(right.astype(precision)), dtype=np.float64)

        return solve
