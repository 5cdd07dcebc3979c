"""How the active stress of the tissue follows the inputs that make it, at the stretch that the tissue has.

    s = s_a + w K_a A(λ − λ_ref):   δs = δs_a + w δK_a A(λ − λ_ref) − w K_a A δλ_ref,   at a fixed λ

What λ itself does is the equilibrium's affair. Source: `active_stiffness`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ...arrays import FloatArray
from ...snapshot import State

_MPA_PER_KPA = 1e-3


@dataclass(frozen=True)
class TensionChange:
    """The linear map from changes of the inputs to changes of the active stress at the nodes, and its transpose.

    `average` is A, shape (nodes, elements); `beyond` is A(λ − λ_ref) and `stiffness` w K_a in MPa, both of shape
    (nodes,); `given` is where λ_ref is the input and not the unit's own, shape (elements,); `share` is w.
    """

    average: csr_matrix
    beyond: FloatArray
    stiffness: FloatArray
    given: np.ndarray
    share: float

    def along(self, changes: State) -> FloatArray:
        """δs in MPa, shape (nodes,), for changes of the inputs."""
        reference = self.average @ np.where(self.given, changes["reference_stretch"], 0.0)
        by_stiffness = self.share * self.beyond * changes["active_stiffness"]
        return np.asarray(_MPA_PER_KPA * (changes["active_stress"] + by_stiffness) - self.stiffness * reference)

    def back(self, gradient: FloatArray) -> dict[str, FloatArray]:
        """Gradients by the inputs, for one by s in 1/MPa, shape (nodes,)."""
        reference = -(self.average.T @ (self.stiffness * gradient))
        return {
            "active_stress": _MPA_PER_KPA * gradient,
            "active_stiffness": _MPA_PER_KPA * self.share * self.beyond * gradient,
            "reference_stretch": np.where(self.given, reference, 0.0),
        }
