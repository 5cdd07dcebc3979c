"""The length of a vector of whatever magnitude."""

import numpy as np

from ..participants.participant import Values

#: Lengths whose squares are neither too large nor too small for a floating-point number.
_SMALL, _LARGE = 1e-140, 1e140


def norm(values: Values) -> float:
    """The Euclidean norm, also where squares would overflow or vanish: what diverges is not to be taken for equal."""
    with np.errstate(over="ignore", under="ignore"):
        length = float(np.linalg.norm(values))
        if _SMALL < length < _LARGE:
            return length
        largest = float(np.max(np.abs(values), initial=0.0))
        return largest * float(np.linalg.norm(values / largest)) if 0.0 < largest < np.inf else largest
