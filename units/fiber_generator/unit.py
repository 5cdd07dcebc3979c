"""The fibre generator unit: static fibre and sheet directions from the anatomy (docs/model.md, Fibre generator).

The sheet direction s₀ points through the wall, from endocardium to epicardium. The fibre lies in the plane normal to
s₀, at the angle θ from the horizontal. Through the wall, θ varies linearly between its values at the two surfaces, and
towards the apex it decreases linearly to zero. Both directions are computed once, at the initialisation, and are
constant per element. The relative distance β from the epicardium is computed at the nodes, where it is 0 and 1 on the
two surfaces, and averaged over the nodes of each element.

In scenes of points, lines and triangles there is no wall, and fibres are parallel to x.

How it fails: a mesh without the named boundaries is refused with InvalidInput, and so is a mesh with elements for which
no direction through the wall can be found.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..mesh import Mesh
from ..mesh.frame import apex_warnings
from ..mesh.transmural import transmural_direction, wall_distance
from ..mesh.wall import wall_of
from ..snapshot import State
from ..unit import Unit
from ..variable import Causality, Location, Variable, parameter

#: Sum of the two wall distances in mm that is zero but for rounding.
_TOUCHING_MM = 1e-9

#: 1 − |cosine| of the angle to the Z axis up to which a direction is vertical but for rounding.
_VERTICAL = 1e-12


@dataclass(frozen=True)
class HelixRule:
    """θ = (β θ_end + (1 − β) θ_epi)(1 − Z/Z_apex), β = D_epi/(D_epi + D_end)."""

    endocardial_angle_deg: float = parameter(60.0, "deg", "theta_end, fibre angle at the endocardium")
    epicardial_angle_deg: float = parameter(-60.0, "deg", "theta_epi, fibre angle at the epicardium")
    apex_z_mm: float = parameter(-70.0, "mm", "Z of the left ventricle's apex, where the angle is zero", below=0.0)

    def warnings(self, mesh: Mesh) -> Iterator[str]:
        """See Placed."""
        yield from apex_warnings(mesh, self.apex_z_mm)

    def angle(self, inward: FloatArray, z: FloatArray) -> FloatArray:
        """θ in rad from the relative distance β and the height in mm."""
        degrees = inward * self.endocardial_angle_deg + (1.0 - inward) * self.epicardial_angle_deg
        return np.asarray(np.deg2rad(degrees) * (1.0 - z / self.apex_z_mm))


def relative_distance(to_epicardium: FloatArray, to_endocardium: FloatArray) -> FloatArray:
    """β, 0 on the epicardium and 1 on the endocardium; 0.5 where both distances vanish."""
    across = to_epicardium + to_endocardium
    return np.divide(to_epicardium, across, out=np.full_like(across, 0.5), where=across > _TOUCHING_MM)


def rotated_fiber(sheet: FloatArray, angle: FloatArray) -> FloatArray:
    """a₀ = cos θ e₃ − sin θ e₂, e₂ the Z axis made normal to s₀, e₃ = s₀ × e₂; shape (elements, 3).

    Where s₀ is vertical, in single elements at the very apex, the Z axis gives no direction in the wall. Any is as good
    there, and the X axis takes its place.
    """
    vertical = np.abs(sheet[:, 2]) > 1.0 - _VERTICAL
    reference = np.where(vertical[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    upward = reference - np.einsum("ei,ei->e", reference, sheet)[:, None] * sheet
    upward /= np.linalg.norm(upward, axis=1, keepdims=True)
    around = np.cross(sheet, upward)
    return np.asarray(np.cos(angle)[:, None] * around - np.sin(angle)[:, None] * upward)


def _along_x(elements: int) -> dict[str, FloatArray]:
    """Fibres along x and sheets along y, for scenes without a wall."""
    return {name: np.tile(axis, (elements, 1)) for name, axis in (("fiber", np.eye(3)[0]), ("sheet", np.eye(3)[1]))}


class FiberGenerator(Unit):
    """Rule-based fibres, without inputs; a step changes nothing."""

    name = "fiber_generator"
    groups = (HelixRule,)
    fields = (
        Variable(
            "fiber",
            Causality.OUTPUT,
            "1",
            "fibre direction a0, a unit vector",
            Location.ELEMENT,
            components=3,
            fixed=True,
        ),
        Variable(
            "sheet",
            Causality.OUTPUT,
            "1",
            "sheet direction s0 from endocardium to epicardium, a unit vector",
            Location.ELEMENT,
            components=3,
            fixed=True,
        ),
    )

    @classmethod
    def check_mesh(cls, mesh: Mesh) -> None:
        """InvalidInput for tetrahedra without the surfaces of a wall."""
        if mesh.dimension == 3:
            wall = wall_of(mesh)
            mesh.boundary_nodes(*wall.endocardium, *wall.epicardium)

    def prepare(self) -> None:
        """Nothing has to be prepared."""

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """Fibre and sheet directions."""
        mesh = self.mesh
        if mesh.dimension < 3:
            return _along_x(mesh.elements)
        wall = wall_of(mesh)
        sheet = transmural_direction(mesh, wall.endocardium, wall.epicardium)
        inward = relative_distance(
            wall_distance(mesh.points, mesh, wall.epicardium), wall_distance(mesh.points, mesh, wall.endocardium)
        )
        angle = self.parameters(HelixRule).angle(inward[mesh.cells].mean(axis=1), mesh.centroids[:, 2])
        return {"fiber": rotated_fiber(sheet, angle), "sheet": sheet}

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """The directions do not change."""
        return dict(state)

    def output(self, name: str, state: State) -> FloatArray:
        """Fibre or sheet directions, shape (elements, 3)."""
        return state[name]
