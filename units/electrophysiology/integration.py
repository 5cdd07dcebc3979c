"""The monodomain equation in time, in NumPy: substeps of second order, implicit in K + G, explicit in the currents.

It is the oracle of the compiled substeps (units/kernels/monodomain.h), and what takes their place where there are none
or the ionic model has no compiled twin.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import FloatArray
from ..conjugate_gradients import conjugate_gradients
from .ionic.model import IonicModel, Rates
from .monodomain import Monodomain
from .progress import LARGEST_PHI, NOT_ACTIVATED, SOLVER_ITERATIONS, SOLVER_TOLERANCE, Limits, Progress, unsolved

#: One substep: from the values, and their expected increments, to the values at its end and their actual increments.
Step = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

#: The substep of an equation while the elements' stretches are held, of a length in ms, with the rates of the cells.
Stepper = Callable[[Monodomain, FloatArray, float, Rates], Step]

#: The implicit-explicit method (2,2,2) of Ascher, Ruuth & Spiteri 1997, section 2.6: second order, L-stable.
_GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
_DELTA = 1.0 - 1.0 / (2.0 * _GAMMA)


class MonodomainStep:
    """One substep of `step` ms with the operator A = K + G and the source G φ_s: slivers' fast modes decay."""

    def __init__(
        self, equation: Monodomain, operator: csr_matrix, source: FloatArray, step: float, rates: Rates
    ) -> None:
        self._equation = equation
        self._operator = operator
        self._source = source
        self._step = step
        self._rates = rates
        self._matrix = csr_matrix(equation.mass + _GAMMA * step * operator)

    def __call__(self, values: FloatArray, expected: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A substep from φ and the states `values`, shape (1 + states, nodes).

        `expected`, shape (2, nodes), are the extrapolated increments of φ to the middle stage and to the end, where the
        solver starts. Returns the values at the end, and by how much φ grew. StepFailure if a linear system is
        not solved.
        """
        step, implicit = self._step, _GAMMA * self._step
        phi = values[0]
        inertia = self._equation.mass @ phi
        load1, rates1 = self._explicit(values)
        guess = phi + expected[0]
        middle = self._solve(inertia + implicit * (load1 + self._source), guess)
        load2, rates2 = self._explicit(np.vstack([middle, values[1:] + implicit * rates1]))
        linear = self._source - self._operator @ middle
        forces = _DELTA * load1 + (1.0 - _DELTA) * load2 + (1.0 - _GAMMA) * linear + _GAMMA * self._source
        # What was wrong with the stage is wrong with the end as well, and in proportion.
        after = self._solve(inertia + step * forces, phi + expected[1] + (middle - guess) / _GAMMA)
        states = values[1:] + step * (_DELTA * rates1 + (1.0 - _DELTA) * rates2)
        return np.vstack([after, states]), np.stack([middle - phi, after - phi])

    def _explicit(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The load f of the ionic current, and the rates of the states in 1/ms, shape (states, nodes)."""
        equation = self._equation
        at_nodes = np.stack(self._rates(*values))
        at_points = at_nodes[0] if equation.nodal else self._rates(*(values @ equation.to_points.T))[0]
        return equation.load @ (equation.point_rate * at_points), equation.node_rate * at_nodes[1:]

    def _solve(self, right: FloatArray, guess: FloatArray) -> FloatArray:
        solution = conjugate_gradients(self._matrix, right, guess, SOLVER_TOLERANCE, SOLVER_ITERATIONS)
        if solution is None:
            raise unsolved()
        return solution


def stepper(equation: Monodomain, stretch: FloatArray, step: float, rates: Rates) -> MonodomainStep:
    """The substep of `step` ms while the stretches λ of the elements, shape (elements,), are held."""
    conductance = equation.conductance(stretch)
    source = equation.reversal * np.asarray(conductance.sum(axis=1)).ravel()
    return MonodomainStep(equation, csr_matrix(equation.diffusion + conductance), source, step, rates)


class Integration:
    """The substeps of `equation` with the cells of `ionic`, each made by `make`."""

    def __init__(self, equation: Monodomain, ionic: IonicModel, limits: Limits, make: Stepper = stepper) -> None:
        self._make = make
        self._equation = equation
        self._rates = ionic.rates
        self._limits = limits

    def advance(
        self, progress: Progress, first: FloatArray, last: FloatArray, time: float, substep: float, count: int
    ) -> Progress:
        """`count` substeps of `substep` ms from `time` (ms), while the stretch runs from `first` to `last`.

        Each substep sees the stretch as it is in its middle. StepFailure for a system that is not solved, and for
        potentials beyond the limits.
        """
        values, activation_time, increments = progress.values, progress.activation_time, progress.increments
        held = np.array_equal(first, last)
        step = self._make(self._equation, last, substep, self._rates) if held else None
        ratio = substep / progress.substep_ms if progress.substep_ms else 0.0
        for number in range(count):
            before = values[0]
            if not held:
                middle = first + (number + 0.5) / count * (last - first)
                step = self._make(self._equation, middle, substep, self._rates)
            assert step is not None
            values, grown = step(values, ratio * (2.0 * increments[::2] - increments[1::2]))
            self._check(values[0])
            activation_time = self._activated(activation_time, before, values[0], time + number * substep, substep)
            increments = np.stack([grown[0], increments[0], grown[1], increments[2]])
            ratio = 1.0
        return Progress(values, activation_time, increments, substep)

    def _check(self, phi: FloatArray) -> None:
        if phi.min() <= self._limits.lowest_phi:
            raise self._limits.too_low(int(phi.argmin()))
        if not np.abs(phi).max() <= LARGEST_PHI:
            node = int(np.abs(phi).argmax())
            raise self._limits.too_large(node, float(phi[node]))

    def _activated(
        self, earlier: FloatArray, before: FloatArray, after: FloatArray, time: float, substep: float
    ) -> FloatArray:
        threshold = self._limits.activation_phi
        crossed = (earlier == NOT_ACTIVATED) & (before < threshold) & (after >= threshold)
        times = np.array(earlier)
        times[crossed] = time + substep * (threshold - before[crossed]) / (after[crossed] - before[crossed])
        return times
