"""How an error develops from step to step in a loop of two units that respond without delay.

With the loop's gain g an error e of what one unit is given comes back as g e. What is given at the end of a step is
extrapolated from the ends of earlier ones, by a polynomial of order k: e = 1 − (1 − 1/z)^(k+1) of the newest where
errors grow by z from step to step. So

    Gauss–Seidel, where one of two inputs is extrapolated:  1 = g (1 − (1 − 1/z)^(k+1)),   z = g for held inputs
    Jacobi, where both are:                                 1 = g (1 − (1 − 1/z)^(k+1))²,  z² = g for held inputs

A share w of the first unit's stiffness in the second one turns g into g (1 − w)/(1 − w g): with all of it, w = 1,
nothing comes back.
"""

import numpy as np
from numpy.polynomial import Polynomial


def amplification(gain: complex, jacobi: bool, extrapolation: int) -> float:
    """The factor by which errors grow in a step, the largest |z|: a loop is stable below 1."""
    if not np.isfinite(gain):
        return np.inf
    order = extrapolation + 1
    power = Polynomial([0.0, 1.0]) ** order
    # Times z^(k+1); its highest terms cancel.
    foreseen = power - Polynomial([-1.0, 1.0]) ** order
    equation = power**2 - gain * foreseen**2 if jacobi else power - gain * foreseen
    return float(np.abs(equation.trim().roots()).max(initial=0.0))


def stabilised(gain: complex, share: float) -> complex:
    """The gain that is left with a `share` of the stiffness; infinite where the stabilised unit has none."""
    left = 1.0 - share * gain
    return gain * (1.0 - share) / left if left != 0.0 else complex(np.inf)
