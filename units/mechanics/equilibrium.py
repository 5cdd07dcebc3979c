"""Static equilibrium of the solid: Newton's method, safeguarded, with one factorisation shared by many steps.

Each Newton system is solved by conjugate gradients, preconditioned by the factorised tangent of an earlier
deformation. It is factorised anew, at the present deformation, when that no longer helps. Which deformation it was
belongs to the state (`Factored`), so that a step repeated from a saved state gives the same bits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, cg, splu

from ..arrays import FloatArray, frozen
from ..errors import StepFailure
from ..variable import parameter
from .solid import Solid

#: Conjugate-gradient iterations after which factorising the present tangent is cheaper than going on.
_CG_ITERATIONS = 7
#: Part of the Newton system's residual that is left: enough for fast convergence, no more.
_CG_TOLERANCE = 1e-3
#: Decrease of the residual in an iteration, up to which the tangent is kept for the next one.
_KEEP_TANGENT = 0.05
#: Decrease of energy, relative to the slope, that a step has to bring (Armijo).
_SUFFICIENT = 1e-4
#: Halvings of a Newton step, and of a load increment, before giving up.
_STEP_HALVINGS = 12
_LOAD_HALVINGS = 6


@dataclass(frozen=True)
class Convergence:
    """When an equilibrium counts as found."""

    equilibrium_tolerance: float = parameter(
        1e-8, "1", "largest nodal residual force, over shear modulus times element size squared", above=0.0, below=1e-2
    )
    newton_iterations: int = parameter(
        25, "1", "Newton iterations before the load step is halved", at_least=1, below=1001
    )


@dataclass(frozen=True)
class Factored:
    """The deformation whose tangent is factorised: displacement (nodes, 3) in mm and nodal tension in MPa."""

    displacement: FloatArray
    tension: FloatArray

    def is_at(self, other: "Factored") -> bool:
        """Whether both are the same deformation, to the bit."""
        return np.array_equal(self.displacement, other.displacement) and np.array_equal(self.tension, other.tension)


@dataclass(frozen=True)
class Solution:
    """An equilibrium: displacement, shape (nodes, 3), in mm, and the factorisation it leaves for the next one."""

    displacement: FloatArray
    factored: Factored


class _NotConverged(Exception):
    """A single load step failed; its message says how."""


class Equilibrium:
    """Equilibria of one solid.

    Parameters
    ----------
    solid:
        What is deformed.
    force_scale:
        Force in N that `Convergence.equilibrium_tolerance` is relative to.
    convergence:
        Tolerance and limit of Newton's method.
    """

    def __init__(self, solid: Solid, force_scale: float, convergence: Convergence) -> None:
        self._solid = solid
        self._limit = convergence.equilibrium_tolerance * force_scale
        self._iterations = convergence.newton_iterations
        self._held: tuple[Factored, Callable[[FloatArray], FloatArray]] | None = None

    def solve(
        self, start: FloatArray, guess: FloatArray, before: FloatArray, tension: FloatArray, factored: Factored
    ) -> Solution:
        """The equilibrium under the nodal `tension` (MPa).

        `start` is the equilibrium under the tension `before`; `guess` is where to begin. If that fails, the tension is
        raised from `before` in smaller and smaller increments, each from the equilibrium below it.

        Raises
        ------
        StepFailure
            When the smallest increment fails too.
        """
        try:
            return self._newton(guess, tension, factored)
        except _NotConverged:
            pass
        solution, done, increment = Solution(start, factored), 0.0, 1.0
        while done < 1.0:
            target = min(done + increment, 1.0)
            try:
                solution = self._newton(solution.displacement, before + target * (tension - before), solution.factored)
                done = target
                increment *= 2.0
            except _NotConverged as failure:
                increment *= 0.5
                if increment < 0.5**_LOAD_HALVINGS:
                    largest = 1000.0 * tension[np.abs(tension).argmax()]
                    raise StepFailure(
                        f"no equilibrium beyond {100.0 * done:.0f} % of the change of active stress (largest "
                        f"{largest:.4g} kPa): {failure}. Load steps down to 1/{2**_LOAD_HALVINGS} were tried. Take "
                        "shorter communication steps, refine the mesh at that element, or check the active stress"
                    ) from None
        return solution

    def _newton(self, displacement: FloatArray, tension: FloatArray, factored: Factored) -> Solution:
        energy, residual = self._solid.energy_and_residual(displacement, tension)
        if not np.isfinite(energy):
            raise _NotConverged("an element is inverted where the iteration starts")
        tangent = None
        for iteration in range(self._iterations + 1):
            if np.abs(residual).max(initial=0.0) <= self._limit:
                return Solution(frozen(displacement), factored)
            if iteration == self._iterations:
                break
            if tangent is None:
                tangent = self._solid.tangent(displacement, tension)
            correction, factored = self._correction(tangent, displacement, tension, residual, factored)
            before = np.linalg.norm(residual)
            displacement, energy, residual = self._search(displacement, tension, correction, energy, residual)
            if np.linalg.norm(residual) > _KEEP_TANGENT * before:
                tangent = None
        raise _NotConverged(
            f"Newton's method left a residual of {np.abs(residual).max():.3g} N (limit {self._limit:.3g} N) after "
            f"{self._iterations} iterations"
        )

    def _correction(
        self,
        tangent: csr_matrix,
        displacement: FloatArray,
        tension: FloatArray,
        residual: FloatArray,
        factored: Factored,
    ) -> tuple[FloatArray, Factored]:
        operator = LinearOperator(tangent.shape, matvec=self._solver(factored))
        step, failed = cg(tangent, -residual, rtol=_CG_TOLERANCE, maxiter=_CG_ITERATIONS, M=operator)
        if failed or not np.isfinite(step).all() or step @ residual >= 0.0:
            factored = Factored(frozen(displacement), frozen(tension))
            step = self._solver(factored)(-residual)
        if not np.isfinite(step).all() or step @ residual >= 0.0:
            raise _NotConverged("the tangent stiffness is not positive definite: the solid is unstable there")
        correction = np.zeros_like(displacement)
        correction[self._solid.free] = step
        return correction, factored

    def _search(
        self, displacement: FloatArray, tension: FloatArray, correction: FloatArray, energy: float, residual: FloatArray
    ) -> tuple[FloatArray, float, FloatArray]:
        """A fraction of the Newton step that inverts no element and lowers the energy or the residual."""
        slope = float(correction[self._solid.free] @ residual)
        fraction = 1.0
        for _ in range(_STEP_HALVINGS):
            trial = displacement + fraction * correction
            # A trial that goes much too far overflows; its energy is infinite or NaN, and it is not taken.
            with np.errstate(over="ignore", invalid="ignore"):
                trial_energy, trial_residual = self._solid.energy_and_residual(trial, tension)
                smaller = np.linalg.norm(trial_residual) < 0.5 * np.linalg.norm(residual)
            # Near the minimum the energy's decrease drowns in rounding; there the residual decides.
            if smaller or trial_energy <= energy + _SUFFICIENT * fraction * slope:
                return trial, trial_energy, trial_residual
            fraction *= 0.5
        ratio = self._solid.volume_ratio(displacement)
        raise _NotConverged(
            f"no part of the Newton step lowers the energy (element {int(ratio.argmin())} is compressed most, volume "
            f"ratio {ratio.min():.3g})"
        )

    def _solver(self, factored: Factored) -> Callable[[FloatArray], FloatArray]:
        """The factorised tangent at `factored`, made anew only if another deformation's is held."""
        if self._held is None or not self._held[0].is_at(factored):
            tangent = self._solid.tangent(factored.displacement, factored.tension).tocsc()
            # The tangent is symmetric: diagonal pivots and an ordering of A + Aᵀ halve time and fill.
            options = {"SymmetricMode": True}
            try:
                factors = splu(tangent, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
            # What SuperLU says of a zero pivot, and SciPy of numbers that are none.
            except (RuntimeError, ValueError) as error:
                raise _NotConverged(f"the tangent stiffness cannot be factorised ({error})") from None
            self._held = (factored, factors.solve)
        return self._held[1]
