"""The stiffness that is kept factorised, and the deformation it belongs to."""

from dataclasses import dataclass

import numpy as np

from ...arrays import FloatArray, frozen
from ..solid import Solid
from .factorisation import Factorisation, NotFactorised, Solve


class NotConverged(Exception):
    """A method found no equilibrium; the message says how it failed."""


@dataclass(frozen=True)
class Factored:
    """The deformation whose stiffness is factorised: displacement (nodes, 3) in mm and loads in MPa.

    `spent` are the iterations beyond one for every equilibrium, which fresher factors might have spared. It all belongs
    to the state of whoever looks for equilibria, so that a step repeated from a saved state, with other factors at
    hand, gives the same bits.
    """

    displacement: FloatArray
    loads: FloatArray
    spent: int = 0

    @classmethod
    def here(cls, displacement: FloatArray, loads: FloatArray) -> "Factored":
        """The present deformation."""
        return cls(frozen(displacement), frozen(loads))

    def is_at(self, other: "Factored") -> bool:
        """Whether both are the same deformation, to the bit."""
        return (self.displacement is other.displacement and self.loads is other.loads) or (
            np.array_equal(self.displacement, other.displacement) and np.array_equal(self.loads, other.loads)
        )


@dataclass(frozen=True)
class Solution:
    """An equilibrium: displacement, shape (nodes, 3), in mm, and the factorisation it leaves for the next one."""

    displacement: FloatArray
    factored: Factored


class Factors:
    """The factors of one deformation at a time."""

    def __init__(self, solid: Solid, factorisation: Factorisation) -> None:
        self._solid, self._factorisation = solid, factorisation
        self._held: tuple[Factored, Solve] | None = None

    def at(self, factored: Factored) -> Solve:
        """What solves with the stiffness at `factored`, made anew only if another deformation's is held.

        NotConverged where it is not positive definite.
        """
        if self._held is None or not self._held[0].is_at(factored):
            try:
                solve = self._factorisation(self._solid.tangent(factored.displacement, factored.loads))
            except NotFactorised as error:
                raise NotConverged(str(error)) from None
            self._held = (factored, solve)
        return self._held[1]


def largest(residual: FloatArray) -> float:
    """The largest component of a residual in N; NaN if one is that."""
    return float(np.abs(residual).max(initial=0.0))
