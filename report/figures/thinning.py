"""Of many places, as many as glyphs find room at."""

import numpy as np
from scipy.spatial import cKDTree

from ...orchestrator.participants.participant import Values
from .surface import Numbers


def thinned(places: Values, spacing_mm: float) -> Numbers:
    """The numbers of places, shape (n, 3), no two of them nearer than `spacing_mm`; the same ones on every call."""
    free = np.ones(len(places), dtype=bool)
    near = cKDTree(places).query_ball_point(places, spacing_mm) if len(places) else []
    # In the order of the mesh, they would stand in rows.
    for number in np.random.default_rng(0).permutation(len(places)):
        if free[number]:
            free[near[number]] = False
            free[number] = True
    return np.flatnonzero(free)
