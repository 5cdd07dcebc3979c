"""The derivative of the active stress with respect to potential and stretch: the step's closed forms, node by node.

A ramped step is a mean over the moments m at which the potential may change, whose part of the earlier tension is

    g(d, d₀) = ∫₀¹ exp(−m d₀ − (1 − m) d) dm,   ∂g/∂d₀ = −∫₀¹ m exp(…) dm,   ∂g/∂d + ∂g/∂d₀ = −g

with the decays d₀ and d at the potentials of begin and end. Both potentials move by the same change.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.special import exprel

from .arrays import FloatArray
from .snapshot import State

#: Below −x of this size a series stands in for a difference that would cancel; its terms.
_SMALL, _TERMS = 0.5, 14


@dataclass(frozen=True)
class ActiveStressDerivative:
    """See Derivative.

    `tension` is ∂s_a/∂Φ in kPa/mV at the stretch 1 and `factor` what the stretch makes of the tension, both of shape
    (nodes,); `by_length` is ∂s_a/∂λ in kPa at the nodes, of the stretch averaged around each by `average`, shape
    (nodes, elements), which is None without `length_dependence`.
    """

    tension: FloatArray
    factor: FloatArray
    by_length: FloatArray
    length_dependence: float
    average: csr_matrix | None

    def along(self, changes: State) -> dict[str, FloatArray]:
        """See Derivative."""
        tension, stretch = self.tension * changes["potential"], changes["stretch"]
        around = 0.0 if self.average is None else self.by_length * (self.average @ stretch)
        return {
            "active_stress": np.asarray(self.factor * tension + around),
            "active_stiffness": self.length_dependence * tension,
            "reference_stretch": np.zeros_like(stretch) if self.average is None else stretch,
        }

    def back(self, weights: State) -> dict[str, FloatArray]:
        """See Derivative."""
        stress, stiffness = weights["active_stress"], weights["active_stiffness"]
        reference = weights["reference_stretch"]
        potential = self.tension * (self.factor * stress + self.length_dependence * stiffness)
        if self.average is None:
            return {"potential": potential, "stretch": np.zeros_like(reference)}
        return {"potential": potential, "stretch": self.average.T @ (self.by_length * stress) + reference}


def held_slope(
    tension: FloatArray, target: FloatArray, decay: FloatArray, target_slope: float, decay_slope: FloatArray
) -> FloatArray:
    """∂/∂Φ of the tension after a step at a held potential, from the `tension` before; arrays of any one shape."""
    return np.asarray(-target_slope * np.expm1(-decay) + (target - tension) * np.exp(-decay) * decay_slope)


def ramped_slope(
    tension: FloatArray,
    targets: tuple[FloatArray, FloatArray],
    decays: tuple[FloatArray, FloatArray],
    target_slope: float,
    decay_slopes: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """∂/∂Φ of the tension after a ramped step; of target, decay and the decay's slope those at begin and end."""
    (first, last), (earlier, decay), (earlier_slope, slope) = targets, decays, decay_slopes
    least, apart = np.exp(-np.minimum(decay, earlier)), -np.abs(decay - earlier)
    kept, bent = least * exprel(apart), least * exprel_slope(apart)
    # The larger of the two decays is weighted by m of its own, the smaller by what is left.
    by_earlier = np.where(earlier >= decay, -bent, bent - kept)
    by_last = -kept - by_earlier
    return np.asarray(
        target_slope * (1.0 - kept)
        - (first - last) * exprel_slope(-decay) * slope
        + (tension - first) * (by_earlier * earlier_slope + by_last * slope)
    )


def exprel_slope(x: FloatArray) -> FloatArray:
    """The derivative of (eˣ − 1)/x for x ≤ 0, which is ∫₀¹ m exp(m x) dm."""
    near = np.minimum(-_SMALL, x)
    far = (np.exp(near) - exprel(near)) / near
    term, series = np.ones_like(x), np.zeros_like(x)
    inside = np.maximum(x, -_SMALL)
    for number in range(_TERMS):
        series = series + term / (number + 2)
        term = term * inside / (number + 1)
    return np.where(x < -_SMALL, far, series)
