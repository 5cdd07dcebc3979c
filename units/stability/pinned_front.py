"""Where a front stops between two elements, because the elements are coarse compared with its width.

Without recovery the monodomain equation on a line is Nagumo's. Discretised, it has fronts that stand between two nodes
as long as the diffusion between neighbours is too weak to lift the next node over its threshold (Keener 1987, SIAM J.
Appl. Math. 47, 556–572): they are stationary solutions of −K φ + f(φ) = 0, which vanish in a saddle-node where the
number d β_t/(c h²) exceeds a value that depends on the threshold, the mass matrix and the ionic current alone.

The standing front is continued here from no diffusion, where it is a jump, to the largest number for which it exists,
on the matrices that the electrophysiology uses.
"""

from dataclasses import replace
from functools import cache
from typing import ClassVar

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.linalg import spsolve

from ..arrays import FloatArray
from ..electrophysiology.ionic.aliev_panfilov import AlievPanfilov
from ..electrophysiology.monodomain import Conduction, Monodomain
from ..electrophysiology.time_scale import TimeScale
from ..errors import InvalidInput
from ..mesh import Mesh
from .theory import Coupled, Theory

#: Elements of the line on which the front stands: it is flat within three of them.
_ELEMENTS = 24
_NEWTON_ITERATIONS, _TOLERANCE = 30, 1e-11
#: Numbers from which the continuation begins, and what it leaves between existence and none, relative to the number.
_BEGINS = (0.0, *np.geomspace(1e-4, 0.1, 16).tolist())
_SMALLEST_STEP = 1e-5


class PinnedFront(Theory):
    """On a strand without recovery: elements above this size stop the wave."""

    name: ClassVar[str] = "pinned_front"
    formula: ClassVar[str] = "a front passes where d β_t/(c h²) exceeds that of the last standing front"
    costly: ClassVar[bool] = True
    of_exchange: ClassVar[bool] = False

    def amplification(self, coupled: Coupled) -> float:
        """h over the largest element size that a wave passes; InvalidInput unless the mesh is a strand."""
        unit = coupled.only("electrophysiology")
        mesh = None if coupled.mesh is None else coupled.mesh()
        if mesh is None or mesh.dimension != 1:
            raise InvalidInput("the theory pinned_front applies to a strand; choose a scene of line elements")
        if unit.parameters["ionic_model"] != AlievPanfilov.name:
            raise InvalidInput("the theory pinned_front applies to the ionic model aliev_panfilov")
        conduction, ionic = unit.group(Conduction), unit.group(AlievPanfilov)
        time_scale = unit.group(TimeScale)
        along = conduction.diffusion_isotropic_mm2_per_ms + conduction.diffusion_anisotropic_mm2_per_ms
        scale = float(time_scale(mesh.points[:, 2]).max())
        strength = along * scale / (ionic.excitation_rate * float(mesh.volumes.mean()) ** 2)
        last = _last_standing(ionic.excitation_threshold, conduction.mass_matrix, conduction.ionic_current)
        return float(np.sqrt(last / strength))


@cache
def _last_standing(threshold: float, mass_matrix: str, ionic_current: str) -> float:
    """The largest d β_t/(c h²) with a standing front; 0 where fronts pass elements of any size."""
    line = _Line(threshold, mass_matrix, ionic_current)
    # An integrated current lets no jump stand still, but it may stand where diffusion rounds it.
    begins = ((start, front) for start in _BEGINS if (front := line.front(start, line.jump)) is not None)
    strength, front = next(begins, (0.0, None))
    if front is None:
        return 0.0
    step = 1e-3
    while step > _SMALLEST_STEP * max(strength, _SMALLEST_STEP):
        following = line.front(strength + step, front)
        if following is None:
            step *= 0.5
        else:
            strength, front, step = strength + step, following, 1.5 * step
    return strength


class _Line:
    """Elements of length 1, with c = β_t = 1, on which the left half is excited."""

    def __init__(self, threshold: float, mass_matrix: str, ionic_current: str) -> None:
        self._threshold = threshold
        places = np.arange(_ELEMENTS + 1.0)
        points = np.column_stack([places, np.zeros((len(places), 2))])
        cells = np.column_stack([np.arange(_ELEMENTS), np.arange(1, _ELEMENTS + 1)])
        fiber = np.tile([1.0, 0.0, 0.0], (_ELEMENTS, 1))
        conduction = replace(
            Conduction(mass_matrix=mass_matrix, ionic_current=ionic_current),
            diffusion_isotropic_mm2_per_ms=1.0,
            diffusion_anisotropic_mm2_per_ms=0.0,
        )
        self._equation = Monodomain(Mesh(points, cells), fiber, np.ones_like, conduction)
        self.jump = np.where(places <= _ELEMENTS // 2, 1.0, 0.0)

    def front(self, strength: float, guess: FloatArray) -> FloatArray | None:
        """The standing front near `guess`, by Newton's method; None if there is none."""
        equation, phi = self._equation, guess.copy()
        for _ in range(_NEWTON_ITERATIONS):
            at = equation.to_points @ phi
            residual = equation.load @ (at * (1.0 - at) * (at - self._threshold)) - strength * (
                equation.diffusion @ phi
            )
            if np.abs(residual).max() < _TOLERANCE:
                # One that has run away by an element is another front.
                return phi if np.abs(phi - self.jump).max() < 0.5 + self._threshold / 2.0 else None
            slope = -3.0 * at**2 + 2.0 * (1.0 + self._threshold) * at - self._threshold
            tangent = equation.load @ diags_array(slope) @ equation.to_points - strength * equation.diffusion
            change = spsolve(tangent.tocsc(), -residual)
            if not np.isfinite(change).all() or np.abs(change).max() > 1.0:
                return None
            phi = phi + change
        return None
