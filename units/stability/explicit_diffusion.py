"""Diffusion by an explicit step (`electrophysiology.explicit_step`): the shortest wave limits the stable substep.

Heun's method multiplies a mode that decays at the rate λ by |1 − λh + (λh)²/2|, which is below 1 where λh < 2. The
fastest is the largest eigenvalue of (K + G) v = λ M v, computed on the scene's mesh (`electrophysiology.fastest_mode`),
and the decay of excited cells back to their plateau besides: tissue on its plateau has both, so that it fails first,
tissue at rest where λ_max alone comes to 2/h. On a uniform mesh of lines of h mm, λ_max = 4 d/h² with the lumped mass
and 12 d/h² with the consistent one, so that halving the elements takes a quarter of the substep.

G is that of the largest stretch of each element in a sound run, where there is one. With `diffusion_step: implicit` no
mode of diffusion limits the substep, and what is left is the limit of the cells (`reaction_step`).
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..arrays import FloatArray
from ..electrophysiology.fastest_mode import fastest_rate
from ..electrophysiology.monodomain import Conduction, Monodomain
from ..electrophysiology.time_scale import TimeScale
from ..electrophysiology.unit import Resolution
from ..errors import InvalidInput
from ..fiber_generator import FiberGenerator
from ..mesh.refinement import refined
from .reaction_step import fastest_decay, substep_ms, two_stages
from .started import started
from .theory import Coupled, Theory

#: Systems of which the eigenvalue is remembered.
_MOST_KNOWN = 100


@dataclass
class ExplicitDiffusion(Theory):
    """One unit `electrophysiology`: its substep against the fastest mode of diffusion on its mesh."""

    name: ClassVar[str] = "explicit_diffusion"
    formula: ClassVar[str] = "h (λ_max + λ_cell) < 2, (K + G) v = λ M v"
    of_exchange: ClassVar[bool] = False
    _known: dict[Hashable, float] = field(default_factory=dict)

    def amplification(self, coupled: Coupled) -> float:
        """See Theory."""
        decay = fastest_decay(coupled)
        if coupled.only("electrophysiology").group(Resolution).diffusion_step == "explicit":
            decay += self.fastest_mode(coupled)
        return two_stages(decay * substep_ms(coupled))

    def fastest_mode(self, coupled: Coupled) -> float:
        """λ_max in 1/ms; InvalidInput without a scene, or without fibres where diffusion follows them."""
        if coupled.mesh is None:
            raise InvalidInput("the theory applies to tissue in a scene; add a `scene` to the scenario")
        setting, mesh = coupled.only("electrophysiology"), coupled.mesh()
        conduction, time_scale = setting.group(Conduction), setting.group(TimeScale)
        levels = setting.group(Resolution).refine
        directions, stretch = _directions(coupled), _stretch(coupled)
        key = (mesh.fingerprint, conduction, time_scale, levels, _bits(directions), _bits(stretch))
        if key not in self._known:
            inner = refined(mesh, levels)
            fiber = directions
            if not isinstance(fiber, np.ndarray):
                fiber = np.asarray(started(FiberGenerator, mesh, fiber, {}).get("fiber"))
            equation = Monodomain(inner.mesh, fiber[inner.parents], time_scale, conduction)
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[key] = fastest_rate(equation, None if stretch is None else stretch[inner.parents])
        return self._known[key]


def _directions(coupled: Coupled) -> FloatArray | Mapping[str, Any]:
    """The fibres of a sound run, or the parameters by which they are generated."""
    for moment in coupled.moments():
        if "fiber" in moment:
            return moment["fiber"]
    return coupled.only("fiber_generator").parameters


def _bits(given: FloatArray | Mapping[str, Any] | None) -> Hashable:
    """What tells one from another."""
    if isinstance(given, np.ndarray):
        return hash(given.tobytes())
    return None if given is None else tuple(sorted(given.items()))


def _stretch(coupled: Coupled) -> FloatArray | None:
    stretches = [moment["stretch"] for moment in coupled.moments() if "stretch" in moment]
    return np.max(stretches, axis=0) if stretches else None
