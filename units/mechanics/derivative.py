"""The derivative of an equilibrium's outputs by the inputs: through the loads, the tangent, and the displacement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import FloatArray
from ..snapshot import State
from .loads.tension_change import TensionChange
from .tangent import Tangent

_MPA_PER_KPA = 1e-3


@dataclass(frozen=True)
class MechanicsDerivative:
    """See Derivative; of the finite-element mechanics.

    `tension` and `tangent` are at the equilibrium. `pressures` names the inputs of the surface loads in their order,
    `unused` those of cavities that the mesh has not. `outputs` has the derivative of each output by the free
    degrees of freedom, shape (numbers, unknowns), and the output's shape.
    """

    tension: TensionChange
    tangent: Tangent
    pressures: Sequence[str]
    unused: Sequence[str]
    outputs: Mapping[str, tuple[csr_matrix, tuple[int, ...]]]

    def along(self, changes: State) -> dict[str, FloatArray]:
        """See Derivative."""
        pressures = _MPA_PER_KPA * np.array([float(changes[name]) for name in self.pressures])
        moved = self.tangent.displacement(self.tension.along(changes), pressures)
        return {name: np.reshape(matrix @ moved, shape) for name, (matrix, shape) in self.outputs.items()}

    def back(self, weights: State) -> dict[str, FloatArray]:
        """See Derivative."""
        gradient = np.asarray(sum(matrix.T @ np.ravel(weights[name]) for name, (matrix, _) in self.outputs.items()))
        tension, pressures = self.tangent.loads(gradient)
        by_pressure = dict(zip(self.pressures, _MPA_PER_KPA * pressures, strict=True))
        return self.tension.back(tension) | by_pressure | {name: np.zeros(()) for name in self.unused}
