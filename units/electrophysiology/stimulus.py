"""The initial stimulus: a potential set on the nodes in a box at the base (docs/model.md, Electrophysiology)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..mesh import Mesh
from ..variable import VOLTAGE, parameter

#: Depth in mm that stands for a stimulus of the surface (Z > −1e-4 mm) when the depth is given as 0.
_SURFACE = 1e-4

#: Part of a mesh's nodes above which a stimulus is more than a place where a wave begins.
_MANY = 0.25


@dataclass(frozen=True)
class Stimulus:
    """Nodes with x_min < X < x_max, |Y| < half width and Z > −depth start at the stimulus potential."""

    stimulus_potential_mV: float = parameter(-10.0, "mV", "potential of the stimulated nodes at the start", **VOLTAGE)
    stimulus_x_min_mm: float = parameter(0.0, "mm", "lower X limit of the stimulus box")
    stimulus_x_max_mm: float = parameter(31.0, "mm", "upper X limit of the stimulus box")
    stimulus_half_width_mm: float = parameter(10.0, "mm", "limit of |Y| of the stimulus box", above=0.0)
    stimulus_depth_mm: float = parameter(
        2.0, "mm", "depth of the stimulus box below the base; 0: only the nodes of the base", at_least=0.0
    )

    def nodes(self, points: FloatArray) -> np.ndarray:
        """Mask of the stimulated ones among `points` (mm), shape (points,); InvalidInput if there is none."""
        inside = self._inside(points)
        if not inside.any():
            raise InvalidInput(
                f"no node of the mesh lies in the stimulus box {self.stimulus_x_min_mm:g} < X < "
                f"{self.stimulus_x_max_mm:g}, |Y| < {self.stimulus_half_width_mm:g}, "
                f"Z > {-self.stimulus_depth_mm:g} mm; enlarge the box (stimulus_depth_mm) or refine the mesh"
            )
        return inside

    def warnings(self, mesh: Mesh) -> Iterator[str]:
        """See Placed; in scenes of fewer dimensions the box is as large as one likes."""
        count = int(np.count_nonzero(self._inside(mesh.points)))
        if not count:
            yield "no node of the mesh lies in the stimulus box, whose sides are stimulus_x_min_mm and so on"
        if mesh.dimension == 3 and count > _MANY * mesh.nodes:
            yield (
                f"{count} of {mesh.nodes} nodes lie in the stimulus box, which is open upward above Z = "
                f"{-self.stimulus_depth_mm:g} mm; expected some at the base"
            )

    def _inside(self, points: FloatArray) -> np.ndarray:
        x, y, z = points.T
        inside = (x > self.stimulus_x_min_mm) & (x < self.stimulus_x_max_mm)
        inside &= np.abs(y) < self.stimulus_half_width_mm
        return np.asarray(inside & (z > -max(self.stimulus_depth_mm, _SURFACE)))
