"""The mechanics unit: quasi-static equilibrium of the heart's wall under active stress and cavity pressures.

    W = ½μ(I₁ − 3) − μ ln J + ½λ_L(ln J)² + W_f,   S = 2∂W/∂C + s_a (a₀⊗a₀ + 0.4 s₀⊗s₀ + 0.4 n₀⊗n₀)

Displacement fixed on `base`, no inertia. Inputs: the active stress at the nodes, where it depends on the stretch its
stiffness and the stretch it holds at (`loads/active_stiffness`), the pressures in the cavities, and once fibre and
sheet. Outputs: stretch per element, displacement, the volumes of the cavities, the apex's uplift, and the twist and
mean strains of the left ventricle's wall (`wall_motion`).
Other passive laws are chosen by `material`, quadratic displacements by `element_order`. Source: docs/model.md,
Mechanics.

Loose tolerances are dangerous here: resting tissue fires by itself where λ − 1 > 3.3e-5.

How it fails: where no equilibrium is found, not even with the change of the loads cut into 64 steps, the step ends
with StepFailure. With the energy as printed in the source document (`neo_hooke_log_sign: as_printed`) the undeformed
tissue is not stress-free, so that there is no state to start from: the initialisation ends with StepFailure.
"""

from collections.abc import Callable, Iterator

import numpy as np
from scipy.sparse import csr_matrix

from .. import kernels
from ..arrays import FloatArray, IntArray, frozen
from ..differentiable import Differentiable
from ..directions import FIBER_INPUT, SHEET_INPUT, check_directions, given_sheet
from ..errors import InvalidInput, StepFailure
from ..mesh import Mesh
from ..mesh.cavity import cavity_faces
from ..mesh.wall import wall_of
from ..snapshot import State
from ..taken import Taken
from ..variable import Causality, Location, Record, Variable
from .bulk import Tissue
from .derivative import MechanicsDerivative
from .elements.registry import Elements
from .laws.neo_hooke import NeoHooke
from .laws.registry import LAWS, Material
from .loads.active_stiffness import Stabilization
from .loads.active_stress import ActiveShares
from .loads.cavity_pressure import CavityPressure
from .loads.registry import SUPPORTS
from .loads.tension_change import TensionChange
from .solid import Solid
from .solvers.choice import LinearSolver
from .solvers.equilibrium import Convergence, Equilibrium
from .solvers.factored import Factored
from .solvers.predictor import MEMORY, Predictor
from .tangent import Tangent
from .wall_motion import WallMotion, wall_outputs

_MPA_PER_KPA = 1e-3
_ML_PER_MM3 = 1e-3

#: Stress in the undeformed tissue, relative to its shear modulus, that is rounding.
_STRESS_FREE = 1e-9

#: The cavities' volumes and the pressures in them.
_PRESSURES = {"lv_volume": "lv_pressure", "rv_volume": "rv_pressure"}

_FOLLOWS_ALL = (
    "active_stress",
    "active_stiffness",
    "reference_stretch",
    *_PRESSURES.values(),
    "fiber",
    "sheet",
)

_OF_THE_WALL = tuple(variable.name for variable in wall_outputs(_FOLLOWS_ALL))


class Mechanics(Differentiable):
    """Finite-element mechanics of the wall."""

    name = "mechanics"
    memoryless = True
    groups = (Material, *LAWS, ActiveShares, Stabilization, *SUPPORTS, Elements, Convergence, LinearSolver)
    fields = (
        Variable("active_stress", Causality.INPUT, "kPa", "active stress along the fibre", Location.NODE),
        Variable(
            "active_stiffness",
            Causality.INPUT,
            "kPa",
            "derivative of the active stress with respect to the stretch",
            Location.NODE,
            needs="stabilization",
        ),
        Variable(
            "reference_stretch",
            Causality.INPUT,
            "1",
            "stretch at which active stress and active stiffness apply; 0: the value at the beginning of the step",
            Location.ELEMENT,
            needs="stabilization",
        ),
        *(
            Variable(name, Causality.INPUT, "kPa", f"pressure in the {side} ventricle's cavity, if there is one")
            for name, side in (("lv_pressure", "left"), ("rv_pressure", "right"))
        ),
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
        *wall_outputs(_FOLLOWS_ALL),
    )

    @classmethod
    def check_mesh(cls, mesh: Mesh) -> None:
        """InvalidInput for tetrahedra without a base or with cavities that have no sound volume."""
        if mesh.dimension == 3:
            mesh.boundary("base")
            for surfaces in wall_of(mesh).cavities.values():
                cavity_faces(mesh, surfaces)

    def implementation(self) -> str:
        """What computes: kernels and linear solver."""
        kind = kernels.described() if self._solid.compiled else "NumPy"
        return f"{kind}; {self._factorisation.name}"

    def fallbacks(self) -> Iterator[str]:
        """Sentences for a person, where something slow stands in for what is not installed."""
        yield from kernels.fallback()
        yield from self.parameters(LinearSolver).fallback()

    def prepare(self) -> None:
        """Set up the solid; InvalidInput if directions are no unit vectors or a boundary is missing."""
        mesh = self.mesh
        if mesh.dimension != 3:
            raise InvalidInput("finite-element mechanics needs tetrahedra; take the unit local_mechanics in this scene")
        fiber = self._inputs["fiber"]
        check_directions("fiber", fiber)
        sheet = given_sheet(self._inputs["sheet"], fiber)
        check_directions("sheet", sheet, normal_to=fiber)
        space = self.parameters(Elements).space(mesh)
        laws = [self.parameters(law) for law in self.parameters(Material).laws]
        self._modulus = max(law.modulus for law in laws)
        self._cavities = {
            name: CavityPressure(space, cavity_faces(mesh, surfaces))
            for name, surfaces in wall_of(mesh).cavities.items()
        }
        self._solid = Solid(
            space,
            Tissue(fiber, sheet, laws, self.parameters(ActiveShares).tensor(fiber, sheet)),
            _free(len(space.points), space.face_nodes(mesh.boundary("base"))),
            list(self._cavities.values()),
            [load for load in (self.parameters(kind).on(mesh, space) for kind in SUPPORTS) if load is not None],
        )
        self._factorisation = self.parameters(LinearSolver).factorisation(self._solid)
        element_size = float(mesh.volumes.mean()) ** (1.0 / 3.0)
        self._equilibrium = Equilibrium(
            self._solid, self._modulus * element_size**2, self.parameters(Convergence), self._factorisation
        )
        self._predictor = Predictor(self._solid.loads, mesh.nodes, float(np.sqrt(mesh.nodes)))
        self._stabilization = self.parameters(Stabilization).stabilization
        self._apex = int(mesh.points[:, 2].argmin())
        self._wall_motion = WallMotion(mesh, space)

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The undeformed state, brought to equilibrium with the initial loads."""
        stress = self._solid.reference_stress()
        if stress > _STRESS_FREE * self._modulus:
            raise StepFailure(
                f"the undeformed tissue carries a stress of {stress:.3g} MPa although nothing loads it: the strain "
                "energy has no stress-free state to start from"
                + (
                    ". That is the energy with + mu ln J, as printed in the source document; use "
                    "neo_hooke_log_sign: stress_free"
                    if self.parameters(NeoHooke).neo_hooke_log_sign == "as_printed"
                    else ""
                )
            )
        return self.advance(self._undeformed(), inputs, inputs, 0.0, 0.0)

    def _undeformed(self) -> dict[str, FloatArray]:
        rest = frozen(np.zeros((len(self._solid.space.points), 3)))
        stresses = frozen(np.zeros(self._solid.loads))
        unloaded = frozen(np.concatenate([stresses, np.zeros(self.mesh.nodes), np.ones(self.mesh.elements)]))
        undeformed = {
            "displacement": rest,
            "loads": unloaded,
            "factored_displacement": rest,
            "factored_loads": unloaded,
            "factors_spent": np.zeros(()),
        }
        for load, displacement in _CHANGES:
            undeformed |= {load: stresses, displacement: rest}
        return undeformed

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Equilibrium under the loads at the end of the step; a memoryless map but for its starting guess."""
        loads, start = self._loads(state, inputs, step), state["displacement"]
        change = (loads - state["loads"])[: self._solid.loads]
        foreseen = self._predictor(
            change,
            [state[load] for load, _ in _CHANGES],
            [state[displacement] for _, displacement in _CHANGES],
        )
        factored = Factored(state["factored_displacement"], state["factored_loads"], int(state["factors_spent"]))
        solution = self._equilibrium.solve(start, start + foreseen, state["loads"], loads, factored)
        result = {
            "displacement": solution.displacement,
            "loads": loads,
            "factored_displacement": solution.factored.displacement,
            "factored_loads": solution.factored.loads,
            "factors_spent": np.array(float(solution.factored.spent)),
        }
        names = list(_CHANGES)
        if change.any():
            result[names[0][0]], result[names[0][1]] = change, solution.displacement - start
            earlier, later = names[:-1], names[1:]
        else:
            # Nothing was learned.
            earlier, later = names, names
        for (load, displacement), (to_load, to_displacement) in zip(earlier, later, strict=True):
            result |= {to_load: state[load], to_displacement: state[displacement]}
        return result

    def output(self, name: str, state: State) -> FloatArray:
        """Stretch (elements,), displacement (nodes, 3) in mm, volumes in ml, uplift in mm and more scalars."""
        displacement = state["displacement"]
        if name == "displacement":
            return displacement[: self.mesh.nodes]
        if name == "stretch":
            return frozen(self._solid.stretch(displacement))
        if name == "apex_uplift":
            return frozen(displacement[self._apex, 2])
        if name in _OF_THE_WALL:
            return frozen(self._wall_motion.value(name, displacement))
        if name not in self._cavities:
            return frozen(0.0)
        return frozen(_ML_PER_MM3 * self._cavities[name].volume(displacement))

    def derivative(self, taken: Taken, state: State) -> MechanicsDerivative:
        """See Differentiable."""
        solid, displacement = self._solid, state["displacement"]
        reference = self._reference(taken.before or self._undeformed(), taken.inputs, taken.step)
        average, dependence = solid.active_stiffness.average, solid.dependence(state["loads"])
        tension = TensionChange(
            average=average,
            # Also where there is no stiffness yet.
            beyond=average @ (solid.stretch(displacement) - reference),
            stiffness=np.zeros(self.mesh.nodes) if dependence is None else dependence.stiffness,
            given=taken.inputs["reference_stretch"] != 0.0,
            share=self._stabilization,
        )
        tangent = Tangent(solid, displacement, state["loads"])
        at_nodes, forces = solid.selection(), solid.pressure_forces(displacement)
        matrices = {
            "stretch": tangent.stretch,
            "displacement": at_nodes[: 3 * self.mesh.nodes],
            "apex_uplift": at_nodes[3 * self._apex + 2],
        }
        # A pressure of 1 MPa has the potential −V.
        matrices |= {name: csr_matrix(-_ML_PER_MM3 * force) for name, force in zip(self._cavities, forces, strict=True)}
        for name in _OF_THE_WALL:
            matrices[name] = csr_matrix(at_nodes.T @ self._wall_motion.gradient(name, displacement).ravel())
        absent = _PRESSURES.keys() - self._cavities.keys()
        matrices |= {name: csr_matrix((1, solid.unknowns)) for name in absent}
        return MechanicsDerivative(
            tension,
            tangent,
            [_PRESSURES[name] for name in self._cavities],
            [_PRESSURES[name] for name in absent],
            {name: (matrix, self.variable(name).shape(self.mesh)) for name, matrix in matrices.items()},
        )

    def stretch_response(self) -> Callable[[FloatArray], FloatArray]:
        """How the stretch responds to a small change of the active stress at present, its own stiffness left out.

        From changes of the active stress at the nodes in MPa, shape (nodes,), to changes of the stretch, (elements,).
        """
        state, still = self.get_state().state, np.zeros(len(self._cavities))
        tangent = Tangent(self._solid, state["displacement"], state["loads"][: self._solid.loads])
        return lambda change: tangent.stretch @ tangent.displacement(change, still)

    def _loads(self, state: State, inputs: State, step: float) -> FloatArray:
        """As `Solid` has them: stresses and active stiffness in MPa, and the stretch they hold at."""
        pressures = [np.atleast_1d(inputs[_PRESSURES[name]]) for name in self._cavities]
        stiffness = self._stabilization * inputs["active_stiffness"]
        stresses = _MPA_PER_KPA * np.concatenate([inputs["active_stress"], *pressures, stiffness])
        reference = self._reference(state, inputs, step) if stiffness.any() else state["loads"][len(stresses) :]
        return frozen(np.concatenate([stresses, reference]))

    def _reference(self, state: State, inputs: State, step: float) -> FloatArray:
        """The stretch that the active stiffness holds at, where there is one."""
        # A step of no length begins where the last one began.
        own = self._solid.stretch(state["displacement"]) if step else state["loads"][-self.mesh.elements :]
        return np.where(inputs["reference_stretch"], inputs["reference_stretch"], own)


#: The last changes of loads and of displacement in the state, the latest first.
_CHANGES = tuple((f"load_change_{number}", f"displacement_change_{number}") for number in range(1, MEMORY + 1))


def _free(nodes: int, fixed: IntArray) -> np.ndarray:
    """All degrees of freedom but those of the nodes `fixed`, shape (nodes, 3)."""
    free = np.ones((nodes, 3), dtype=bool)
    free[np.unique(fixed)] = False
    return free
