"""The mechanics unit: quasi-static equilibrium of the heart's wall under its active stress.

    W = ½μ(I₁ − 3) − μ ln J + ½λ_L(ln J)² + W_f,   S = 2∂W/∂C + s_a (a₀⊗a₀ + 0.4 s₀⊗s₀ + 0.4 n₀⊗n₀)

Displacement fixed on `base`, no other load, no inertia; linear elements. Inputs: the active stress at the nodes, and
once fibre and sheet. Outputs: stretch per element, displacement, the volumes of the cavities, and the apex's uplift.
Source: model.md, Mechanics.

Loose tolerances are dangerous here: resting tissue fires by itself where λ − 1 > 3.3e-5.

How it fails: where no equilibrium is found, not even with the change of active stress cut into 64 load steps, the step
ends with StepFailure. With the energy as the seed prints it (`neo_hooke_log_sign: seed`) the undeformed tissue is not
stress-free, so that there is no state to start from: the initialisation ends with StepFailure.
"""

import numpy as np

from ..arrays import FloatArray, frozen
from ..directions import FIBER_INPUT, SHEET_INPUT, check_directions
from ..errors import InvalidInput, StepFailure
from ..mesh import Mesh
from ..mesh.cavity import Cavity
from ..mesh.wall import wall_of
from ..snapshot import State
from ..unit import Unit
from ..variable import Causality, Location, Record, Variable
from .equilibrium import Convergence, Equilibrium, Factored
from .holzapfel_fiber import HolzapfelFiber
from .neo_hooke import NeoHooke
from .solid import ActiveShares, Solid

_MPA_PER_KPA = 1e-3

#: Stress in the undeformed tissue, relative to its shear modulus, that is rounding.
_STRESS_FREE = 1e-9

_FOLLOWS_ALL = ("active_stress", "fiber", "sheet")


class Mechanics(Unit):
    """Finite-element mechanics of the wall."""

    name = "mechanics"
    memoryless = True
    groups = (NeoHooke, HolzapfelFiber, ActiveShares, Convergence)
    fields = (
        Variable("active_stress", Causality.INPUT, "kPa", "active stress along the fibre", Location.NODE),
        FIBER_INPUT,
        SHEET_INPUT,
        Variable(
            "stretch", Causality.OUTPUT, "1", "stretch along the fibre", Location.ELEMENT, depends_on=_FOLLOWS_ALL
        ),
        Variable(
            "displacement",
            Causality.OUTPUT,
            "mm",
            "displacement",
            Location.NODE,
            components=3,
            depends_on=_FOLLOWS_ALL,
        ),
        *(
            Variable(name, Causality.OUTPUT, unit, description, depends_on=_FOLLOWS_ALL, record=Record.VALUE)
            for name, unit, description in (
                ("lv_volume", "ml", "volume of the left ventricle's cavity, 0 without one"),
                ("rv_volume", "ml", "volume of the right ventricle's cavity, 0 without one"),
                ("apex_uplift", "mm", "Z displacement of the lowest node"),
            )
        ),
    )

    @classmethod
    def check_mesh(cls, mesh: Mesh) -> None:
        """InvalidInput for tetrahedra without a base or with cavities that have no sound volume."""
        if mesh.dimension == 3:
            mesh.boundary("base")
            for surfaces in wall_of(mesh).cavities.values():
                Cavity(mesh, surfaces)

    def prepare(self) -> None:
        """Set up the solid; InvalidInput if directions are no unit vectors or a boundary is missing."""
        if self.mesh.dimension != 3:
            raise InvalidInput("finite-element mechanics needs tetrahedra; take the unit local_mechanics in this scene")
        fiber, sheet = self._inputs["fiber"], self._inputs["sheet"]
        check_directions("fiber", fiber)
        check_directions("sheet", sheet, normal_to=fiber)
        elastic = self.parameters(NeoHooke)
        self._solid = Solid(
            self.mesh,
            fiber,
            (elastic, self.parameters(HolzapfelFiber)),
            self.parameters(ActiveShares).tensor(fiber, sheet),
            self.mesh.boundary_nodes("base"),
        )
        element_size = float(self.mesh.volumes.mean()) ** (1.0 / 3.0)
        self._equilibrium = Equilibrium(
            self._solid, elastic.shear_modulus_MPa * element_size**2, self.parameters(Convergence)
        )
        self._cavities = {name: Cavity(self.mesh, surfaces) for name, surfaces in wall_of(self.mesh).cavities.items()}
        self._apex = int(self.mesh.points[:, 2].argmin())

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The undeformed state, brought to equilibrium with the initial active stress."""
        stress = self._solid.reference_stress()
        if stress > _STRESS_FREE * self.parameters(NeoHooke).shear_modulus_MPa:
            raise StepFailure(
                f"the undeformed tissue carries a stress of {stress:.3g} MPa although nothing loads it: the strain "
                "energy has no stress-free state to start from"
                + (
                    ". That is the energy as the seed prints it, with + mu ln J; use neo_hooke_log_sign: stress_free"
                    if self.parameters(NeoHooke).neo_hooke_log_sign == "seed"
                    else ""
                )
            )
        rest = frozen(np.zeros((self.mesh.nodes, 3)))
        relaxed = frozen(np.zeros(self.mesh.nodes))
        undeformed = {
            "displacement": rest,
            "velocity": rest,
            "tension": relaxed,
            "factored_displacement": rest,
            "factored_tension": relaxed,
        }
        return self.advance(undeformed, inputs, inputs, 0.0, 0.0)

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Equilibrium under the active stress at the end of the step; a memoryless map but for its starting guess."""
        tension = frozen(_MPA_PER_KPA * inputs["active_stress"])
        before = state["displacement"]
        factored = Factored(state["factored_displacement"], state["factored_tension"])
        guess = before + step * state["velocity"]
        solution = self._equilibrium.solve(before, guess, state["tension"], tension, factored)
        velocity = (solution.displacement - before) / step if step > 0.0 else state["velocity"]
        return {
            "displacement": solution.displacement,
            "velocity": velocity,
            "tension": tension,
            "factored_displacement": solution.factored.displacement,
            "factored_tension": solution.factored.tension,
        }

    def output(self, name: str, state: State) -> FloatArray:
        """Stretch (elements,), displacement (nodes, 3) in mm, volumes in ml and uplift in mm (both scalars)."""
        displacement = state["displacement"]
        if name == "displacement":
            return displacement
        if name == "stretch":
            return frozen(self._solid.stretch(displacement))
        if name == "apex_uplift":
            return frozen(displacement[self._apex, 2])
        if name not in self._cavities:
            return frozen(0.0)
        return frozen(self._cavities[name].volume(self.mesh.points + displacement))
