"""A substep of the monodomain equation that is explicit in everything: Heun's method, to show where it must fail.

With A = K + G and λ the eigenvalues of M⁻¹ A, a substep of h ms multiplies each mode by 1 − λh + (λh)²/2: nothing grows
where h ≤ 2/λ_max, and what is beyond that is multiplied without bound, the shortest waves of the mesh first. Cells that
are excited pull the potential back to their plateau besides, at a rate that adds to λ_max.

It is here for that limit. The implicit-explicit substep (`integration`) has none by diffusion.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from ..arrays import FloatArray
from .ionic.model import Rates
from .monodomain import Monodomain


class ExplicitSteps:
    """Makes the explicit substeps of one equation: a consistent mass is factorised once, a lumped one divided by."""

    def __init__(self, equation: Monodomain) -> None:
        if equation.lumped:
            masses = equation.mass.diagonal()
            self._divided: Callable[[FloatArray], FloatArray] = lambda load: load / masses
        else:
            self._divided = splu(csc_matrix(equation.mass)).solve

    def __call__(self, equation: Monodomain, stretch: FloatArray, step: float, rates: Rates) -> "ExplicitStep":
        """The substep of `step` ms while the stretches λ of the elements, shape (elements,), are held."""
        return ExplicitStep(self, equation, stretch, step, rates)

    def without_mass(self, load: FloatArray) -> FloatArray:
        """M⁻¹ times `load`, shape (nodes,)."""
        return self._divided(load)


class ExplicitStep:
    """One substep of `step` ms by Heun's method."""

    def __init__(
        self, steps: ExplicitSteps, equation: Monodomain, stretch: FloatArray, step: float, rates: Rates
    ) -> None:
        self._steps = steps
        self._equation = equation
        conductance = equation.conductance(stretch)
        self._operator = csr_matrix(equation.diffusion + conductance)
        self._source = equation.reversal * np.asarray(conductance.sum(axis=1)).ravel()
        self._step = step
        self._rates = rates

    def __call__(self, values: FloatArray, expected: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A substep from φ and the states `values`, shape (1 + states, nodes); `expected` is not used.

        Returns the values at the end, and by how much φ grew to the second stage and to the end, shape (2, nodes).
        """
        first = self._slopes(values)
        second = self._slopes(values + self._step * first)
        grown = 0.5 * self._step * (first + second)
        return values + grown, np.stack([self._step * first[0], grown[0]])

    def _slopes(self, values: FloatArray) -> FloatArray:
        """The rates of φ and the states in 1/ms, shape (1 + states, nodes)."""
        equation = self._equation
        at_nodes = equation.node_rate * np.stack(self._rates(*values))
        flow = self._source - self._operator @ values[0]
        if equation.nodal:
            # The mass that the current is weighted with is the one that is divided by.
            slope = at_nodes[0] + self._steps.without_mass(flow)
        else:
            at_points = equation.point_rate * self._rates(*(values @ equation.to_points.T))[0]
            slope = self._steps.without_mass(flow + equation.load @ at_points)
        return np.vstack([slope, at_nodes[1:]])
