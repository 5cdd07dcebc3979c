"""The time scale β_t of the ionic model, by the expected time of activation (docs/model.md, Electrophysiology)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..mesh import Mesh
from ..mesh.frame import apex_warnings
from ..variable import parameter


@dataclass(frozen=True)
class TimeScale:
    """β_t = β (1 − τ₀ (t_a − t₀)/(t₁ − t₀)): what activates later repolarises faster.

    The expected activation time t_a is linear in Z. `last_first` grows from the base to the apex, so that the last to
    depolarise is the first to repolarise, as observed. `as_printed` is t_a = t_apex (1 − Z/Z_apex), by which
    the base repolarises first: it runs and contradicts the text around it.

    An ionic model of dimensionless time takes β_t as its unit of time. One whose time constants are in ms has them as
    given where t_a = t₀, and elsewhere multiplied by β_t/β: `time_scale_reduction: 0` gives them everywhere. The
    stretch-activated current has the rate 1/β_t with every model.
    """

    time_scale_ms: float = parameter(12.9, "ms", "beta, time scale at t_a = t_0", above=0.0)
    time_scale_reduction: float = parameter(0.55, "1", "tau_0, relative reduction of beta at t_a = t_1")
    time_scale_start_ms: float = parameter(12.0, "ms", "t_0, start of the reduction")
    time_scale_end_ms: float = parameter(75.0, "ms", "t_1, end of the reduction")
    apex_activation_time_ms: float = parameter(
        50.0, "ms", "t_apex, difference of the expected activation times of apex and base", at_least=0.0
    )
    apex_z_mm: float = parameter(-70.0, "mm", "Z of the left ventricle's apex", below=0.0)
    activation_time_map: str = parameter(
        "last_first",
        "1",
        "expected activation time along Z: last_first grows towards the apex, as_printed towards the base",
        choices=("last_first", "as_printed"),
    )

    def warnings(self, mesh: Mesh) -> Iterator[str]:
        """See Placed; without a reduction no place matters."""
        if self.time_scale_reduction:
            yield from apex_warnings(mesh, self.apex_z_mm)

    def relative(self, z: FloatArray) -> FloatArray:
        """β_t over `time_scale_ms`: the clock of an ionic model whose time constants are in ms."""
        return self(z) / self.time_scale_ms

    def __call__(self, z: FloatArray) -> FloatArray:
        """β_t in ms at the heights `z` in mm; InvalidInput where it is not positive."""
        height = z / self.apex_z_mm
        expected = self.apex_activation_time_ms * (1.0 - height if self.activation_time_map == "as_printed" else height)
        span = self.time_scale_end_ms - self.time_scale_start_ms
        if span == 0.0:
            raise InvalidInput("time_scale_start_ms equals time_scale_end_ms; they have to differ")
        scale = self.time_scale_ms * (1.0 - self.time_scale_reduction * (expected - self.time_scale_start_ms) / span)
        shortest = int(np.argmin(scale))
        if scale[shortest] <= 0.0:
            raise InvalidInput(
                f"the ionic time scale falls to {scale[shortest]:.3g} ms at Z = {z[shortest]:.1f} mm; it has to "
                "stay positive: lower time_scale_reduction or check apex_z_mm"
            )
        return np.asarray(scale)
