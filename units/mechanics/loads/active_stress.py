"""The active stress: a second Piola–Kirchhoff stress, fixed while the solid deforms.

It has the potential ½ s_a (a₀·C a₀ + 0.4 s₀·C s₀ + 0.4 n₀·C n₀), so that equilibrium is the minimum of an energy.
Source: docs/model.md, Mechanics; Bakir et al. 2018.
"""

from dataclasses import dataclass

import numpy as np

from ...arrays import FloatArray
from ...variable import parameter
from ..kinematics import square


@dataclass(frozen=True)
class ActiveShares:
    """How the active stress acts across the fibre (Bakir et al. 2018)."""

    active_share_sheet: float = parameter(0.4, "1", "part of the active stress along the sheet", at_least=0.0)
    active_share_normal: float = parameter(
        0.4, "1", "part of the active stress normal to fibre and sheet", at_least=0.0
    )

    def tensor(self, fiber: FloatArray, sheet: FloatArray) -> FloatArray:
        """a₀⊗a₀ + share s₀⊗s₀ + share n₀⊗n₀, shape (elements, 3, 3)."""
        normal = np.cross(fiber, sheet)
        return square(fiber) + self.active_share_sheet * square(sheet) + self.active_share_normal * square(normal)
