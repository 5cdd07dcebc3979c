"""The derivative of the stretches of elements that are in equilibrium by themselves, by the inputs.

    δs = M (δ(s_a + w K_a A(λ − λ_ref)) + w K_a A δλ),   δλ = (dλ/ds) δs

The first part, at a fixed λ, is of `loads/tension_change`; M averages over an element's nodes, A around a node.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..snapshot import State
from .loads.tension_change import TensionChange
from .local_tension import TensionTangent


@dataclass(frozen=True)
class LocalDerivative:
    """See Derivative; of the local mechanics.

    `slope` is dλ/ds in 1/MPa of each element, shape (elements,). Outputs that are always zero have the shapes `still`,
    and the inputs `unused` move nothing.
    """

    tension: TensionChange
    tangent: TensionTangent
    slope: FloatArray
    still: Mapping[str, tuple[int, ...]]
    unused: Iterable[str]

    def along(self, changes: State) -> dict[str, FloatArray]:
        """See Derivative."""
        stretch = self.slope * self.tangent.along(self.tension.along(changes))
        return {"stretch": stretch} | {name: np.zeros(shape) for name, shape in self.still.items()}

    def back(self, weights: State) -> dict[str, FloatArray]:
        """See Derivative."""
        gradients = self.tension.back(self.tangent.back(self.slope * weights["stretch"]))
        return gradients | {name: np.zeros(()) for name in self.unused}
