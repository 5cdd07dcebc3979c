"""The local mechanics unit: every element in equilibrium by itself, without a mesh between them.

    2∂W/∂C + s_a (a₀⊗a₀ + 0.4 s₀⊗s₀ + 0.4 n₀⊗n₀) = 0 in the axes of fibre, sheet and normal

The same strain energy and variables as finite-element mechanics (`unit`), in every dimension. `free`: each element
contracts as a cube that nothing holds; `isometric`: its fibre keeps its length and the two other directions are free.
On a homogeneous cube that is free to contract, finite elements find the same. Source: model.md, Mechanics.

How it fails: where no equilibrium is found, not even in many small steps of active stress, the step ends with
StepFailure.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray, frozen
from ..errors import StepFailure
from ..snapshot import State
from ..unit import Unit
from ..variable import parameter
from .kinematics import Kinematics
from .laws.registry import LAWS, Material
from .loads.active_stress import ActiveShares
from .unit import Mechanics

_MPA_PER_KPA = 1e-3

#: Residual stress relative to the shear modulus, Newton iterations, and load steps at the most.
_TOLERANCE = 1e-12
_ITERATIONS = 30
_MOST_LOAD_STEPS = 64


#: What the outputs follow; the others are zero.
_FOLLOWS = {"stretch": ("active_stress",)}


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
    groups = (Material, *LAWS, ActiveShares, Hold)
    fields = tuple(replace(variable, depends_on=_FOLLOWS.get(variable.name, ())) for variable in Mechanics.fields)

    def prepare(self) -> None:
        """The axes of the material are those of fibre, sheet and normal: their directions in space do not matter."""
        self._laws = [self.parameters(law) for law in self.parameters(Material).laws]
        self._modulus = max(law.modulus for law in self._laws)
        shares = self.parameters(ActiveShares)
        self._shares = np.array([1.0, shares.active_share_sheet, shares.active_share_normal])
        self._structure = np.zeros((self.mesh.elements, 3, 3))
        self._structure[:, 0, 0] = 1.0
        self._sheet_structure = np.zeros_like(self._structure)
        self._sheet_structure[:, 1, 1] = 1.0
        self._free = slice(1 if self.parameters(Hold).hold == "isometric" else 0, 3)

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """The undeformed state, brought to equilibrium with the initial active stress."""
        undeformed = {"squares": np.ones((self.mesh.elements, 3)), "tension": np.zeros(self.mesh.elements)}
        return self.advance(undeformed, inputs, inputs, 0.0, 0.0)

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Equilibrium under the active stress at the end of the step, found from the last one."""
        tension = _MPA_PER_KPA * inputs["active_stress"][self.mesh.cells].mean(axis=1)
        load_steps = 1
        while load_steps <= _MOST_LOAD_STEPS:
            squares = np.array(state["squares"])
            for number in range(1, load_steps + 1):
                share = number / load_steps
                found = self._newton(squares, (1.0 - share) * state["tension"] + share * tension)
                if found is None:
                    break
                squares = found
            else:
                return {"squares": squares, "tension": tension}
            load_steps *= 4
        raise StepFailure(
            f"no equilibrium found, not even in {_MOST_LOAD_STEPS} load steps; the active stress changes by up to "
            f"{np.abs(tension - state['tension']).max():.3g} MPa: take shorter communication steps"
        )

    def output(self, name: str, state: State) -> FloatArray:
        """Stretch (elements,); nothing is displaced, and there is no cavity."""
        if name == "stretch":
            return frozen(np.sqrt(state["squares"][:, 0]))
        return frozen(np.zeros(self.variable(name).shape(self.mesh)))

    def _newton(self, squares: FloatArray, tension: FloatArray) -> FloatArray | None:
        """The squared stretches along fibre, sheet and normal, shape (elements, 3); None without convergence."""
        free, modulus = self._free, self._modulus
        squares = squares.copy()
        for _ in range(_ITERATIONS):
            at = self._at(squares)
            with np.errstate(over="ignore", invalid="ignore"):
                stress = sum(law.stress(at) for law in self._laws)
                residual = np.einsum("eii->ei", stress) + tension[:, None] * self._shares
                if np.abs(residual[:, free]).max() <= _TOLERANCE * modulus:
                    return squares
                tangent = 0.5 * np.asarray(sum(law.tangent(at)[:, free, free] for law in self._laws))
            # Normal components of the tangent: stress by half the change of the squared stretches.
            # Where the tissue is torn apart its energy overflows, or has no curvature left.
            if not (np.isfinite(tangent).all() and np.isfinite(residual).all()):
                return None
            try:
                change = -np.linalg.solve(tangent, residual[:, free, None])[:, :, 0]
            except np.linalg.LinAlgError:
                return None
            # No square may lose more than half of itself: it stays positive.
            shrunk = np.max(-change / (0.5 * squares[:, free]), axis=1, initial=1.0)
            squares[:, free] += change / shrunk[:, None]
        return None

    def _at(self, squares: FloatArray) -> Kinematics:
        diagonal = np.zeros((len(squares), 3, 3))
        inverse = np.zeros((len(squares), 3, 3))
        np.einsum("eii->ei", diagonal)[:] = squares
        np.einsum("eii->ei", inverse)[:] = 1.0 / squares
        return Kinematics(diagonal, inverse, 0.5 * np.log(squares).sum(axis=1), self._structure, self._sheet_structure)
