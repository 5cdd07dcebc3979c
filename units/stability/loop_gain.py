"""The loop of an active stress that depends on the stretch, and of mechanics, which responds without delay.

    δs_a = K_a δλ,   δλ = −δs_a/K_p:   an error comes back as g = −K_a/K_p times itself, however short the step

K_a = s_a η is the active stiffness; 1/K_p is how the stretch answers the active stress by the tangent of the deformed
tissue. In tissue of many elements g is the eigenvalue of largest modulus of the linearised way from stretch to stretch:
averaged to the nodes, times K_a, through the mechanics. What the schemes make of it is in `recurrence`. Source:
Regazzoni & Quarteroni 2021 (Comput. Methods Appl. Mech. Engrg. 373, 113506).

The gain changes in a beat. It is taken at the moments of a sound run, where there is one, and the largest counts; else
where all tissue is depolarised and stays so, which is where the active stress is largest. The cavities' pressures count
where the moments hold them (`lv_pressure`, `rv_pressure` in kPa). A stabilised mechanics averages the stretch as the
active stress does, so that of every eigenvalue the same is left as of one gain.
"""

from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from ..active_stress import ActiveStress
from ..arrays import FloatArray
from ..electrophysiology import Electrophysiology
from ..errors import InvalidInput, StepFailure
from ..fiber_generator import FiberGenerator
from ..mechanics import LocalMechanics, Mechanics
from ..mesh import Mesh
from ..mesh.averages import around_nodes
from ..unit import Unit
from .recurrence import amplification, stabilised
from .started import started
from .theory import Coupled, Moment, Theory

_KPA_PER_MPA = 1000.0

_MECHANICS: dict[str, type[Mechanics] | type[LocalMechanics]] = {
    kind.name: kind for kind in (Mechanics, LocalMechanics)
}

#: Steps of the potential in which tissue at rest is depolarised: gently, for a large one may leave what has a solution.
_LEVELS = 10
#: Long enough for every delay.
_SETTLED_S = 1e3
#: Change of the stretch in a step that is none, and steps at the most.
_STILL, _MOST_STEPS = 1e-6, 200

#: Unknowns up to which all eigenvalues are computed, and relative error of the largest beyond.
_DENSE, _TOLERANCE = 30, 1e-6


class LoopGain(Theory):
    """See Theory; of the loop between active stress and mechanics through the stretch."""

    name: ClassVar[str] = "loop_gain"
    formula: ClassVar[str] = "|g| < 1, g = −K_a/K_p"
    costly: ClassVar[bool] = True

    def amplification(self, coupled: Coupled) -> float:
        """See Theory: the largest over the moments. Units that ramp their inputs do not ramp the stretch.

        StepFailure where there are no moments, and no plateau is found.
        """
        share = float(coupled.only(*_MECHANICS).parameters["stabilization"])
        factors = [
            amplification(stabilised(gain, share), coupled.jacobi, coupled.extrapolation)
            for gain in self.gains(coupled)
        ]
        return max(factors, default=0.0)

    def gains(self, coupled: Coupled) -> list[complex]:
        """g at each moment, the stabilisation left out; empty where the active stress does not depend on the stretch.

        Raises
        ------
        InvalidInput
            Without a mesh, or without exactly one active stress and one mechanics.
        StepFailure
            Where there are no moments, and no plateau is found, or where a moment has no equilibrium.
        """
        stress, mechanics = coupled.only(ActiveStress.name), coupled.only(*_MECHANICS)
        dependence = float(stress.parameters["length_dependence"])
        if not dependence:
            return []
        if coupled.mesh is None:
            raise InvalidInput("the theory of the loop gain needs a `scene`, on whose mesh the units are solved")
        mesh = coupled.mesh()
        average = around_nodes(mesh.cells, mesh.volumes)
        moments: Sequence[Moment] = coupled.moments() or [_plateau(coupled, mesh)]
        unit = started(_MECHANICS[mechanics.kind], mesh, mechanics.parameters, moments[0])
        gains = []
        for moment in moments:
            for name in moment.keys() & _changing(type(unit)):
                unit.set(name, moment[name])
            unit.do_step(0.0, 1e-3)
            around = average @ moment["stretch"]
            factor = 1.0 + dependence * (around - 1.0)
            if not factor.min() > 0.0:
                node = int(factor.argmin())
                raise StepFailure(
                    f"length_dependence {dependence:g} leaves no active stress at node {node}, where the stretch is "
                    f"{around[node]:.3g}: no loop gain is known there"
                )
            stiffness = dependence * moment["active_stress"] / _KPA_PER_MPA / factor
            gains.append(_dominant(_loop(unit.stretch_response(), average, stiffness), mesh.nodes))
        return gains


def _loop(
    response: Callable[[FloatArray], FloatArray], average: csr_matrix, stiffness: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """From a change of the active stress at the nodes in MPa to the change that comes back."""
    return lambda change: stiffness * (average @ response(change))


def _dominant(loop: Callable[[FloatArray], FloatArray], size: int) -> complex:
    """The eigenvalue of largest modulus of a linear map of vectors, shape (size,)."""
    if size <= _DENSE:
        values = np.linalg.eigvals(np.stack([loop(column) for column in np.eye(size)], axis=1))
    else:
        operator = LinearOperator((size, size), matvec=lambda column: loop(column.ravel()), dtype=np.float64)
        # Always the same start, for the same bits.
        start = 1.0 + 1e-3 * np.arange(size) / size
        if not np.any(operator @ start):
            return 0.0
        try:
            values = eigs(operator, 1, which="LM", v0=start, tol=_TOLERANCE, return_eigenvectors=False)
        except ArpackError as error:
            raise StepFailure(f"the gain of the loop of active stress and mechanics was not found: {error}") from None
    return complex(values[np.abs(values).argmax()])


def _plateau(coupled: Coupled, mesh: Mesh) -> Moment:
    """The state that active stress and mechanics settle in where all tissue is depolarised and stays so."""
    directions = _directions(coupled, mesh)
    stress_setting, mechanics = coupled.only(ActiveStress.name), coupled.only(*_MECHANICS)
    # The settled state is the same, and these reach it by any step.
    stress = started(ActiveStress, mesh, {**stress_setting.parameters, "time_integration": "exact"}, {})
    unit = started(_MECHANICS[mechanics.kind], mesh, {**mechanics.parameters, "stabilization": 1.0}, directions)
    stretch, change = unit.get("stretch"), np.inf
    rest, amplitude = _action_potential(coupled)
    for number in range(1, _MOST_STEPS + 1):
        stress.set("potential", np.full(mesh.nodes, rest + amplitude * min(number / _LEVELS, 1.0)))
        stress.set("stretch", stretch)
        stress.do_step(0.0, _SETTLED_S)
        for name in ("active_stress", "active_stiffness", "reference_stretch"):
            unit.set(name, stress.get(name))
        unit.do_step(0.0, _SETTLED_S)
        before, stretch = stretch, unit.get("stretch")
        change = float(np.abs(stretch - before).max())
        if number > _LEVELS and change <= _STILL:
            return {"active_stress": stress.get("active_stress"), "stretch": stretch, **directions}
    raise StepFailure(
        f"active stress and mechanics reach no plateau: the stretch still changes by {change:.2g} in a step after "
        f"{_MOST_STEPS} of them"
    )


def _action_potential(coupled: Coupled) -> tuple[float, float]:
    """Potential at rest and how far a depolarised cell, φ = 1 in all ionic models, is above it, in mV."""
    cells = [unit.parameters for unit in coupled.units.values() if unit.kind == Electrophysiology.name]
    names = ("rest_potential_mV", "potential_range_mV")
    rest, amplitude = (float(cells[0][name] if cells else Electrophysiology.variable(name).start) for name in names)
    return rest, amplitude


def _directions(coupled: Coupled, mesh: Mesh) -> dict[str, FloatArray]:
    """Fibre and sheet of the system's generator; along the axes where it has none."""
    generators = [unit for unit in coupled.units.values() if unit.kind == FiberGenerator.name]
    names = ("fiber", "sheet")
    if generators:
        generator = started(FiberGenerator, mesh, generators[0].parameters, {})
        return {name: generator.get(name) for name in names}
    return {name: np.tile(axis, (mesh.elements, 1)) for name, axis in zip(names, np.eye(3), strict=False)}


def _changing(kind: type[Unit]) -> set[str]:
    """The inputs of a mechanics that a moment may hold, but for what stabilises it."""
    return {item.name for item in kind.inputs() if not item.fixed and not item.needs}
