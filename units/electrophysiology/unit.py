"""The electrophysiology unit: the monodomain equation in the material frame, with one of several ionic models.

    ∂Φ/∂t = ∇·(D∇Φ) − (β_φ/β_t)(Ĩ_e + Ĩ_m),   zero flux,   Ĩ_m = G_s max(λ − 1, 0)(φ − φ_s)

Ĩ_e is the ionic current of the model that the parameter `ionic_model` chooses (`ionic`). The state of the unit contains
φ, the states of the ionic model under their names, the activation times, and the last increments of φ, from which the
solver extrapolates its next initial guess.

The inputs are the stretch λ of the elements, held over a step or varying linearly (each substep then uses its value in
the middle of the substep), and the fibre directions, which are set once. The outputs are the transmembrane potential
and the activation time at the nodes, and the potential at three probes. Source: docs/model.md, Electrophysiology.

With `refine` the unit solves on a nested refinement of the mesh of the scene. A refined element has the fibre and the
stretch of the element in which it lies; potential and activation time are given at the nodes of the scene's mesh.

The elements are linear. Time is integrated by an implicit-explicit Runge–Kutta method of second order, in substeps of
equal length (`integration`), in compiled code where possible (`compiled`). With `diffusion_step: explicit` diffusion is
explicit as well (`explicit_step`), which limits the length of the substep.

How it fails: elements coarser than the wave front (≈ 8 mm) give wrong speeds. A potential that is no longer finite, or
a linear system that cannot be solved, ends the step with StepFailure. With `explicit_limit: ignored` substeps may be
longer than the explicit part permits: excited cells then rest at a potential that is not a solution of the model, and
the numbers may still be finite (`stability.reaction_step`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from .. import kernels
from ..arrays import FloatArray, frozen
from ..directions import FIBER_INPUT, check_directions
from ..errors import InvalidInput, StepFailure
from ..mesh.refinement import check_levels, refined
from ..snapshot import State
from ..unit import Unit
from ..variable import VOLTAGE, Causality, Location, Record, Refinement, Variable, parameter, parameters_of
from .compiled import CompiledIntegration, compiled
from .explicit_step import ExplicitSteps
from .fastest_mode import fastest_rate
from .integration import Integration
from .ionic.model import IonicModel
from .ionic.registry import IONIC_MODELS, IonicChoice
from .monodomain import Conduction, Monodomain
from .probes import PROBED, Probes, probe_outputs
from .progress import NOT_ACTIVATED, Limits, Progress
from .stimulus import Stimulus
from .time_scale import TimeScale

#: Substeps of a communication step that nobody would wait for.
_MOST_SUBSTEPS = 100_000


@dataclass(frozen=True)
class PotentialScale:
    """Φ = β_φ φ + δ_φ, and the potential that counts as activated."""

    rest_potential_mV: float = parameter(-80.0, "mV", "delta_phi, potential at rest", **VOLTAGE)
    potential_range_mV: float = parameter(
        100.0, "mV", "beta_phi, potential range of the action potential", above=0.0, below=VOLTAGE["below"]
    )
    activation_potential_mV: float = parameter(
        -20.0, "mV", "potential whose first upward crossing counts as the activation", **VOLTAGE
    )


@dataclass(frozen=True)
class Resolution:
    """How finely the unit solves inside, in time and in space."""

    longest_substep_ms: float = parameter(
        0.25, "ms", "longest substep inside a communication step", at_least=1e-4, refines=Refinement.STEP
    )
    refine: int = parameter(
        0,
        "1",
        "number of nested refinements of the mesh on which the unit solves; each halves the element size",
        at_least=0,
        refines=Refinement.MESH,
    )
    diffusion_step: str = parameter(
        "implicit",
        "1",
        "implicit: diffusion and stretch current do not limit the substep; explicit: Heun's method, in which they do",
        choices=("implicit", "explicit"),
    )
    explicit_limit: str = parameter(
        "enforced",
        "1",
        "enforced: refuses a longest_substep_ms above the stability limit of the explicit part; ignored: accepts it",
        choices=("enforced", "ignored"),
    )

    def substeps(self, step_ms: float) -> int:
        """Into how many equal substeps a communication step is divided; StepFailure for more than can be computed."""
        count = step_ms / self.longest_substep_ms
        if count > _MOST_SUBSTEPS:
            raise StepFailure(
                f"a step of {step_ms:g} ms would take {count:.3g} substeps of longest_substep_ms = "
                f"{self.longest_substep_ms:g}; take shorter communication steps, or longer substeps"
            )
        return max(1, ceil(count - 1e-9))


class Electrophysiology(Unit):
    """Monodomain equation with a stretch-activated current, on linear elements."""

    name = "electrophysiology"
    interpolates = True
    groups = (
        PotentialScale,
        Resolution,
        IonicChoice,
        *IONIC_MODELS.values(),
        Conduction,
        TimeScale,
        Stimulus,
        Probes,
    )
    fields = (
        Variable(
            "stretch",
            Causality.INPUT,
            "1",
            "stretch along the fibre",
            Location.ELEMENT,
            start=1.0,
            above=0.0,
            needs="stretch_conductance",
        ),
        FIBER_INPUT,
        Variable(
            "potential",
            Causality.OUTPUT,
            "mV",
            "transmembrane potential",
            Location.NODE,
            depends_on=("stretch", "fiber"),
            record=Record.PROBES,
        ),
        Variable(
            "activation_time",
            Causality.OUTPUT,
            "ms",
            "time of the first upward crossing of the activation potential; -1 before it",
            Location.NODE,
            depends_on=("stretch", "fiber"),
            missing=NOT_ACTIVATED,
        ),
        *probe_outputs(depends_on=("stretch", "fiber")),
    )

    def warnings(self) -> Iterator[str]:
        """As for every unit, and parameters of ionic models that are not chosen."""
        yield from super().warnings()
        chosen = self.parameters(IonicChoice).ionic_model
        for name, model in IONIC_MODELS.items():
            changed = [item.name for item in parameters_of(model) if self.get(item.name) != item.start]
            if name != chosen and changed:
                yield (
                    f"parameters of the ionic model {name} have no effect, because ionic_model is {chosen}: "
                    f"{', '.join(changed)}"
                )

    def implementation(self) -> str:
        """What computes the steps, for a person: the compiled kernels and their instructions, or NumPy."""
        return kernels.described() if isinstance(self._integration, CompiledIntegration) else "NumPy"

    def fallbacks(self) -> Iterator[str]:
        """Sentences for a person, where something slow stands in for what is not installed."""
        yield from kernels.fallback()

    def prepare(self) -> None:
        """Assemble mass and diffusion; InvalidInput if fibres, time scale or substep make no sense."""
        fiber = self._inputs["fiber"]
        check_directions("fiber", fiber)
        self._scale = self.parameters(PotentialScale)
        self._ionic: IonicModel = self.parameters(IONIC_MODELS[self.parameters(IonicChoice).ionic_model])
        self._resolution = self.parameters(Resolution)
        time_scale = self.parameters(TimeScale)
        clock = time_scale if self._ionic.dimensionless_time else time_scale.relative
        longest = self._ionic.longest_step * float(clock(self.mesh.points[:, 2]).min())
        self._check_substep(longest, "the explicit step of the ionic model does not resolve the upstroke")
        self._probes = self.parameters(Probes).places(self.mesh)
        check_levels(self.mesh, self._resolution.refine, "parameter 'refine'")
        self._inner = refined(self.mesh, self._resolution.refine)
        inherited = fiber[self._inner.parents]
        equation = Monodomain(self._inner.mesh, inherited, time_scale, self.parameters(Conduction), clock)
        limits = Limits(
            (self._scale.activation_potential_mV - self._scale.rest_potential_mV) / self._scale.potential_range_mV,
            self._ionic.lowest_phi,
            self._lowest_potential,
            self._ionic.lowest_phi_reason,
        )
        self._integration = self._integrated(equation, limits, longest)

    def initial(self, inputs: State) -> dict[str, FloatArray]:
        """Rest, except for the stimulated nodes."""
        stimulus = self.parameters(Stimulus)
        points = self._inner.mesh.points
        potential = np.full(len(points), self._scale.rest_potential_mV)
        potential[stimulus.nodes(points)] = stimulus.stimulus_potential_mV
        if stimulus.stimulus_potential_mV <= self._lowest_potential:
            raise InvalidInput(
                f"parameter 'stimulus_potential_mV' is {stimulus.stimulus_potential_mV:g}; the ionic model is valid "
                f"only above {self._lowest_potential:g} mV"
            )
        already = potential >= self._scale.activation_potential_mV
        phi = (potential - self._scale.rest_potential_mV) / self._scale.potential_range_mV
        return self._state_of(
            Progress(
                np.stack([phi, *self._ionic.initial(phi)]),
                np.where(already, 0.0, NOT_ACTIVATED),
                np.zeros((4, len(points))),
                0.0,
            )
        )

    def advance(self, state: State, begin: State, inputs: State, time: float, step: float) -> dict[str, FloatArray]:
        """Equal substeps, in each of which the stretch is held."""
        if step == 0.0:
            return dict(state)
        substeps = self._resolution.substeps(step)
        progress = Progress(
            np.stack([state[name] for name in ("phi", *self._ionic.states)]),
            state["activation_time"],
            state["increments"],
            float(state["substep_ms"]),
        )
        first, last = (self._inside(values["stretch"]) for values in (begin, inputs))
        return self._state_of(self._integration.advance(progress, first, last, time, step / substeps, substeps))

    def output(self, name: str, state: State) -> FloatArray:
        """Potential in mV or activation time in ms, shape (nodes,); potential at a probe, a scalar."""
        if name in PROBED:
            return frozen(self._probes(self.output("potential", state))[PROBED.index(name)])
        # The first nodes of a refined mesh are those of the scene's.
        if name == "activation_time":
            return state["activation_time"][: self.mesh.nodes]
        phi = state["phi"][: self.mesh.nodes]
        potential = self._scale.rest_potential_mV + self._scale.potential_range_mV * phi
        potential.setflags(write=False)
        return potential

    def _integrated(self, equation: Monodomain, limits: Limits, longest_ms: float) -> Integration | CompiledIntegration:
        if self._resolution.diffusion_step == "implicit":
            return compiled(equation, self._ionic, limits) or Integration(equation, self._ionic, limits)
        # Twice `longest_ms` is where the ionic model's fastest rate alone is unstable.
        if self._resolution.explicit_limit == "enforced":
            limit = 2.0 / (fastest_rate(equation) + 1.0 / longest_ms)
            self._check_substep(limit, "explicit diffusion is unstable on this mesh (diffusion_step: implicit is not)")
        return Integration(equation, self._ionic, limits, ExplicitSteps(equation))

    def _check_substep(self, longest_ms: float, reason: str) -> None:
        """InvalidInput for a longest substep above `longest_ms` for a `reason`, unless that is to be seen."""
        given = self._resolution.longest_substep_ms
        if given > longest_ms and self._resolution.explicit_limit == "enforced":
            raise InvalidInput(
                f"parameter 'longest_substep_ms' is {given:g}; above {longest_ms:.3g} ms {reason}. Lower it, or set "
                "explicit_limit: ignored to see it fail"
            )

    @property
    def _lowest_potential(self) -> float:
        return self._scale.rest_potential_mV + self._ionic.lowest_phi * self._scale.potential_range_mV

    def _inside(self, field: FloatArray) -> FloatArray:
        """A field of the scene's elements on those that the unit solves on."""
        return field if self._inner.mesh is self.mesh else field[self._inner.parents]

    def _state_of(self, progress: Progress) -> dict[str, FloatArray]:
        return {
            **dict(zip(("phi", *self._ionic.states), progress.values, strict=True)),
            "activation_time": progress.activation_time,
            "increments": progress.increments,
            "substep_ms": np.asarray(progress.substep_ms),
        }
