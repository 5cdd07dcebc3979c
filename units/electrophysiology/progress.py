"""The state that a step of the monodomain equation advances, and the failures of a step."""

from dataclasses import dataclass

from ..arrays import FloatArray
from ..errors import StepFailure

#: Activation time of a node that no wave has reached yet.
NOT_ACTIVATED = -1.0

#: Dimensionless potential of which nothing is left but numbers; that of cells lies between 0 and 1.
LARGEST_PHI = 100.0

#: Residual to which the systems of a step are solved, relative to their right-hand sides, and iterations they may take.
SOLVER_TOLERANCE = 1e-9
SOLVER_ITERATIONS = 1000


@dataclass(frozen=True)
class Progress:
    """The present state of the monodomain equation.

    Parameters
    ----------
    values:
        φ, then the ionic model's states, at the nodes; shape (1 + states, nodes).
    activation_time:
        In ms, shape (nodes,).
    increments:
        By how much φ grew from the begin of a substep to its middle stage, in the last substep and in the one before,
        then the same from begin to end; shape (4, nodes). Those of the next substep are extrapolated from them, as
        the first guess of conjugate gradients.
    substep_ms:
        Length of the substep that the increments are of; 0 at the start.
    """

    values: FloatArray
    activation_time: FloatArray
    increments: FloatArray
    substep_ms: float


@dataclass(frozen=True)
class Limits:
    """The dimensionless potentials at which something happens.

    `lowest_mV` is `lowest_phi`, below which the ionic model means nothing for the `reason`, as a person reads it.
    """

    activation_phi: float
    lowest_phi: float
    lowest_mV: float
    reason: str

    def too_low(self, node: int) -> StepFailure:
        """The failure at a node below the lowest potential."""
        return StepFailure(
            f"the potential at node {node} fell below {self.lowest_mV:g} mV, {self.reason}; look for degenerate "
            "elements there or lower longest_substep_ms"
        )

    def too_large(self, node: int, phi: float) -> StepFailure:
        """The failure at a node beyond what a cell reaches."""
        return StepFailure(
            f"the dimensionless potential at node {node} is {phi:.3g}, outside the range of a cell; lower "
            "longest_substep_ms, or check the parameters of the ionic model"
        )


def unsolved() -> StepFailure:
    """The failure of conjugate gradients."""
    return StepFailure(
        f"conjugate gradients did not converge in {SOLVER_ITERATIONS} iterations in a step of the potential; look for "
        "degenerate elements in the mesh or take a smaller longest_substep_ms"
    )
