"""The local mechanics unit: every element in equilibrium by itself, without a mesh between them.

    2∂W/∂C + s_a (a₀⊗a₀ + 0.4 s₀⊗s₀ + 0.4 n₀⊗n₀) = 0 in the axes of fibre, sheet and normal (`local_equilibrium`)

The same strain energy and variables as finite-element mechanics (`unit`), in every dimension. `free`: each element
contracts as a cube that nothing holds; `isometric`: its fibre keeps its length and the two other directions are free.
On a homogeneous cube that is free to contract, finite elements find the same. Source: model.md, Mechanics.

How it fails: where no equilibrium is found, not even in many small steps of active stress, the step ends with
StepFailure.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray, frozen
from ..errors import StepFailure
from ..snapshot import State
from ..unit import Unit
from ..variable import parameter
from .laws.registry import LAWS, Material
from .loads.active_stiffness import Stabilization, StretchDependence
from .loads.active_stress import ActiveShares
from .local_equilibrium import LocalEquilibrium
from .local_tension import LocalTension
from .unit import Mechanics

_MPA_PER_KPA = 1e-3

#: Load steps at the most.
_MOST_LOAD_STEPS = 64

#: What the outputs follow; the others are zero. An element's stretch follows only what is around it; but to write all
#: of that into an FMU would take a hundred times what else is in it, and it may say that an output follows everything.
_FOLLOWS = {"stretch": Mechanics.variable("stretch").depends_on}


@dataclass(frozen=True)
class Hold:
    """What holds the fibre."""

    hold: str = parameter(
        "free",
        "1",
        "free: the fibre shortens as it likes; isometric: it keeps its length",
        choices=("free", "isometric"),
    )


class LocalMechanics(Unit):
    """Pointwise equilibrium of the wall, with the variables of finite-element mechanics."""

    name = "local_mechanics"
    memoryless = True
    groups = (Material, *LAWS, ActiveShares, Stabilization, Hold)
    fields = tuple(replace(variable, depends_on=_FOLLOWS.get(variable.name, ())) for variable in Mechanics.fields)

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
        elements = self.mesh.elements
        undeformed = {
            "squares": np.ones((elements, 3)),
            "tension": np.zeros(elements),
            "reference": np.ones(elements),
        }
        return self.advance(undeformed, inputs, inputs, 0.0, 0.0)

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

    def output(self, name: str, state: State) -> FloatArray:
        """Stretch (elements,); nothing is displaced, and there is no cavity."""
        if name == "stretch":
            return frozen(np.sqrt(state["squares"][:, 0]))
        return frozen(np.zeros(self.variable(name).shape(self.mesh)))

    def stretch_response(self) -> Callable[[FloatArray], FloatArray]:
        """How the stretch answers a small change of the active stress at present, its own stiffness left out.

        From changes of the active stress at the nodes in MPa, shape (nodes,), to changes of the stretch, (elements,).
        """
        slope = self._equilibrium.stretch_by_tension(self.get_state().state["squares"])
        return lambda change: slope * self._tension.in_elements(change)

    def _dependence(self, state: State, inputs: State, step: float) -> StretchDependence:
        stiffness = self._stabilization * _MPA_PER_KPA * inputs["active_stiffness"]
        reference = state["reference"]
        if stiffness.any():
            # A step of no length begins where the last one began.
            own = np.sqrt(state["squares"][:, 0]) if step else reference
            reference = np.where(inputs["reference_stretch"], inputs["reference_stretch"], own)
        return StretchDependence(stiffness, reference)
