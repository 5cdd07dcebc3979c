"""The local mechanics unit: every element is in equilibrium by itself and does not interact with its neighbours.

    2∂W/∂C + s_a (a₀⊗a₀ + 0.4 s₀⊗s₀ + 0.4 n₀⊗n₀) = 0 in the axes of fibre, sheet and normal (`local_equilibrium`)

The strain energy and the variables are those of finite-element mechanics (`unit`), for scenes of any dimension. With
`free`, each element contracts as a cube without any support; with `isometric`, its fibre keeps its length and the two
other directions are free. For a homogeneous cube without support, finite elements give the same result. Source:
docs/model.md, Mechanics.

How it fails: if no equilibrium is found, not even in many small increments of the active stress, the step ends with
StepFailure.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray, frozen
from ..differentiable import Differentiable
from ..errors import StepFailure
from ..snapshot import State
from ..taken import Taken
from ..variable import Causality, Location, Record, parameter
from .laws.registry import LAWS, Material
from .loads.active_stiffness import Stabilization, StretchDependence
from .loads.active_stress import ActiveShares
from .loads.tension_change import TensionChange
from .local_derivative import LocalDerivative
from .local_equilibrium import LocalEquilibrium
from .local_tension import LocalTension
from .unit import Mechanics

_MPA_PER_KPA = 1e-3

#: Load steps at the most.
_MOST_LOAD_STEPS = 64

#: What the outputs follow; the others are zero. An element's stretch follows only what is around it; but to write all
#: of that into an FMU would take a hundred times what else is in it, and it may say that an output follows everything.
_FOLLOWS = {"stretch": Mechanics.variable("stretch").depends_on}

#: Outputs that are always zero, and inputs that nothing follows, since there is no cavity.
_STILL = {item.name for item in Mechanics.fields if item.causality is Causality.OUTPUT} - _FOLLOWS.keys()
_PRESSURES = [item.name for item in Mechanics.inputs() if item.location is Location.GLOBAL]


@dataclass(frozen=True)
class Hold:
    """What holds the fibre."""

    hold: str = parameter(
        "free",
        "1",
        "free: the fibre shortens freely; isometric: it keeps its length",
        choices=("free", "isometric"),
    )


class LocalMechanics(Differentiable):
    """Pointwise equilibrium of the wall, with the variables of finite-element mechanics."""

    name = "local_mechanics"
    memoryless = True
    groups = (Material, *LAWS, ActiveShares, Stabilization, Hold)
    fields = tuple(
        replace(
            variable,
            depends_on=_FOLLOWS.get(variable.name, ()),
            # There is no wall whose motion were worth a column.
            record=Record.NOTHING if variable.recorded_with else variable.record,
        )
        for variable in Mechanics.fields
    )

    def prepare(self) -> None:
        """Set the equilibrium up."""
        shares = self.parameters(ActiveShares)
        self._equilibrium = LocalEquilibrium(
            self.mesh.elements,
            [self.parameters(law) for law in self.parameters(Material).laws],
            np.array([1.0, shares.active_share_sheet, shares.active_share_normal]),
            self.parameters(Hold).hold == "isometric",
        )
        self._tension = LocalTension(self._equilibrium, self.mesh)
        self._stabilization = self.parameters(Stabilization).stabilization

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The undeformed state, brought to equilibrium with the initial active stress."""
        return self.advance(self._undeformed(), inputs, inputs, 0.0, 0.0)

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Equilibrium under the active stress at the end of the step, found from the last one."""
        before = state["tension"]
        stress, dependence = _MPA_PER_KPA * inputs["active_stress"], self._dependence(state, inputs, step)
        load_steps = 1
        while load_steps <= _MOST_LOAD_STEPS:
            squares, tension = np.array(state["squares"]), before
            for number in range(1, load_steps + 1):
                found = self._tension.squares(squares, before, number / load_steps, stress, dependence)
                if found is None:
                    break
                squares, tension = found
            else:
                return {"squares": squares, "tension": tension, "reference": dependence.reference}
            load_steps *= 4
        change = self._tension.in_elements(stress) - before
        raise StepFailure(
            f"no equilibrium found, not even in {_MOST_LOAD_STEPS} load steps; the active stress changes by up to "
            f"{np.abs(change).max():.3g} MPa: take shorter communication steps"
        )

    def derivative(self, taken: Taken, state: State) -> LocalDerivative:
        """See Differentiable."""
        before, inputs = taken.before or self._undeformed(), taken.inputs
        dependence = self._dependence(before, inputs, taken.step)
        around, squares = self._tension.around, state["squares"]
        tension = TensionChange(
            average=around,
            # Also where there is no stiffness yet.
            beyond=around @ (np.sqrt(squares[:, 0]) - self._reference(before, inputs, taken.step)),
            stiffness=dependence.stiffness,
            given=inputs["reference_stretch"] != 0.0,
            share=self._stabilization,
        )
        return LocalDerivative(
            tension,
            self._tension.tangent(squares, dependence),
            self._equilibrium.stretch_by_tension(squares),
            {item.name: item.shape(self.mesh) for item in self.fields if item.name in _STILL},
            _PRESSURES,
        )

    def output(self, name: str, state: State) -> FloatArray:
        """Stretch (elements,); nothing is displaced, and there is no cavity."""
        if name == "stretch":
            return frozen(np.sqrt(state["squares"][:, 0]))
        return frozen(np.zeros(self.variable(name).shape(self.mesh)))

    def stretch_response(self) -> Callable[[FloatArray], FloatArray]:
        """How the stretch responds to a small change of the active stress at present, its own stiffness left out.

        From changes of the active stress at the nodes in MPa, shape (nodes,), to changes of the stretch, (elements,).
        """
        slope = self._equilibrium.stretch_by_tension(self.get_state().state["squares"])
        return lambda change: slope * self._tension.in_elements(change)

    def _dependence(self, state: State, inputs: State, step: float) -> StretchDependence:
        stiffness = self._stabilization * _MPA_PER_KPA * inputs["active_stiffness"]
        reference = self._reference(state, inputs, step) if stiffness.any() else state["reference"]
        return StretchDependence(stiffness, reference)

    def _reference(self, state: State, inputs: State, step: float) -> FloatArray:
        """The stretch that the active stiffness holds at, where there is one."""
        # A step of no length begins where the last one began.
        own = np.sqrt(state["squares"][:, 0]) if step else state["reference"]
        return np.where(inputs["reference_stretch"], inputs["reference_stretch"], own)

    def _undeformed(self) -> dict[str, FloatArray]:
        elements = self.mesh.elements
        return {
            "squares": np.ones((elements, 3)),
            "tension": np.zeros(elements),
            "reference": np.ones(elements),
        }
