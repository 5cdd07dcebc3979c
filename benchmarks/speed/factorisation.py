"""A measure of time that can be compared between machines: one factorisation of the undeformed stiffness of a mesh.

The factorisation is numerical, in double precision and one thread, with the supernodal solver where it is installed.
"""

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.mechanics.bulk import Tissue
from cardiac_cosim.units.mechanics.elements.linear import linear
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares
from cardiac_cosim.units.mechanics.solid import Solid
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.unit import Unit

#: Seconds to spend on repeating something short, and the fewest and the most repetitions.
_SECONDS, _FEWEST, _MOST = 1.0, 3, 200


def fibers_of(mesh: Mesh) -> Unit:
    """The fibre generator on `mesh`, initialised."""
    fibers = FiberGenerator(mesh)
    fibers.enter_initialization_mode()
    fibers.exit_initialization_mode()
    return fibers


def solid_of(mesh: Mesh) -> Solid:
    """The heart's wall on `mesh`, held at its base, in linear elements."""
    fibers = fibers_of(mesh)
    fiber, sheet = fibers.get("fiber"), fibers.get("sheet")
    free = np.ones((mesh.nodes, 3), dtype=bool)
    free[mesh.boundary_nodes("base")] = False
    tissue = Tissue(fiber, sheet, (NeoHooke(), HolzapfelFiber()), ActiveShares().tensor(fiber, sheet))
    return Solid(linear(mesh), tissue, free)


def shortest_ms(call: Callable[[], Any]) -> float:
    """The shortest time in ms that `call` takes, of many."""
    shortest, begin, number = np.inf, perf_counter(), 0
    while number < _FEWEST or (number < _MOST and perf_counter() - begin < _SECONDS):
        start = perf_counter()
        call()
        shortest = min(shortest, perf_counter() - start)
        number += 1
    return 1e3 * shortest


def factorisation_ms(solid: Solid) -> float:
    """The time in ms of one factorisation of the undeformed `solid`'s stiffness."""
    lower = solid.tangent(np.zeros_like(solid.space.points), np.zeros(solid.loads)).lower()
    try:
        import rslab
    except ImportError:
        from scipy.sparse import csc_matrix, tril
        from scipy.sparse.linalg import splu

        full = csc_matrix(lower + tril(lower, -1).T)
        options = {"SymmetricMode": True}
        return shortest_ms(lambda: splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options))
    analysis = rslab.analyze(lower, path="ldlt", threads=1)
    return shortest_ms(lambda: analysis.factor(lower.data))
