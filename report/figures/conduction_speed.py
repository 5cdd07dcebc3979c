"""How fast a wave runs along the fibres and across them, from when it reached each place."""

import numpy as np

from ...orchestrator.participants.participant import Values
from .surface import Numbers

# Where the wave has only begun, it is not yet as fast as it gets; at an edge, where it ends, it is faster. Parts of
# the activated nodes by time that are left out, and distance from the edges relative to the size.
_EARLY, _LATE, _EDGE = 0.15, 0.9, 0.1

# Fewer elements say too little.
_LEAST = 20


def conduction_speeds(points: Values, cells: Numbers, fiber: Values, times_ms: Values) -> tuple[float, float] | None:
    """Speeds in mm/ms, or m/s, of plane waves along the fibres and across them.

    The speed of a plane wave goes with the square root of the conductivity in its direction n: for fibres f it is
    c² = c_along² (n·f)² + c_across² (1 − (n·f)²). The gradient of the activation times is n/c, with which this is
    linear in both squares. They are fitted to all elements.

    Parameters
    ----------
    points, cells:
        Nodes in mm, shape (nodes, 3), and the elements, shape (elements, dimension + 1).
    fiber:
        Unit directions, shape (elements, 3).
    times_ms:
        At the nodes, shape (nodes,), NaN where the wave has not been.

    Returns
    -------
    None where too few elements lie away from the beginning and the edges, or the wave runs one way only.
    """
    known = np.isfinite(times_ms)
    if not known.any():
        return None
    early, late = np.quantile(times_ms[known], [_EARLY, _LATE])
    centres = points[cells].mean(axis=1)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = _EDGE * (high - low).max()
    inside = ((centres - low >= margin) & (high - centres >= margin) | (high == low)).all(axis=1)
    time = times_ms[cells].mean(axis=1)
    used = inside & (time > early) & (time < late)
    if used.sum() < _LEAST:
        return None
    corners, at_corners = points[cells[used]], times_ms[cells[used]]
    edges, rise = corners[:, 1:] - corners[:, :1], at_corners[:, 1:] - at_corners[:, :1]
    gradient = np.einsum("nij,nj->ni", np.linalg.pinv(edges), rise)
    along = np.einsum("ni,ni->n", gradient, fiber[used]) ** 2
    across = np.maximum((gradient**2).sum(axis=1) - along, 0.0)
    # Of large elements there are fewer: each counts by its size.
    weights = np.sqrt(np.sqrt(np.abs(np.linalg.det(edges @ edges.transpose(0, 2, 1)))))
    system = weights[:, None] * np.column_stack([along, across])
    squares, _, rank, _ = np.linalg.lstsq(system, weights, rcond=1e-3)
    if rank < 2 or (squares <= 0.0).any():
        return None
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))
