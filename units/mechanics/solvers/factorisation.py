"""What solves with a stiffness that is kept for many steps, behind one small protocol."""

from collections.abc import Callable
from typing import Protocol

from ...arrays import FloatArray
from ..stiffness import Stiffness

#: From a right-hand side to a solution, shape (unknowns,) both.
Solve = Callable[[FloatArray], FloatArray]


class NotFactorised(Exception):
    """A stiffness is not positive definite, or holds numbers that are none; the message says which."""


class Factorisation(Protocol):
    """Makes solvers of stiffnesses, all of one pattern.

    What they return are preconditioners of the equilibrium's iteration, and need not be exact; they are deterministic.
    `name` says what it is, for a person.
    """

    name: str

    def __call__(self, matrix: Stiffness) -> Solve:
        """A solver with `matrix`; NotFactorised if there is none."""
