"""Solids of a few elements, in any law and order of the displacement: what the tests of the mechanics' parts share."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.mechanics.bulk import Tissue
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.laws.law import Law
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares
from cardiac_cosim.units.mechanics.solid import Solid
from cardiac_cosim.units.mesh import Mesh
from scipy.spatial.transform import Rotation


@pytest.fixture(scope="session")
def cube(box) -> Mesh:
    """A cube of 2 mm in 2 x 2 x 3 hexahedra, all nodes moved off the grid; its side z = 0 is `base`, z = 2 `top`."""
    return box(
        [0, 1, 2],
        [0, 1, 2],
        [0, 0.6, 1.3, 2],
        mapped=lambda at: at + 0.04 * np.sin(3.0 * at[:, [1, 2, 0]] + 1.0),
        base=lambda at: at[:, 2] < 0.01,
        top=lambda at: at[:, 2] > 1.99,
    )


def _frames(elements: int) -> tuple[np.ndarray, np.ndarray]:
    frames = Rotation.random(elements, rng=12).as_matrix()
    return frames[:, 0], frames[:, 1]


@pytest.fixture(scope="session")
def frames() -> Callable[[int], tuple[np.ndarray, np.ndarray]]:
    """Random fibres and sheets of a number of elements."""
    return _frames


@pytest.fixture(scope="session")
def solid_of() -> Callable[..., Solid]:
    """A solid on a mesh: laws, order of the displacement, mask of what is free given the points, and surface loads."""

    def make(
        mesh: Mesh,
        laws: Sequence[Law],
        order: int = 1,
        free: Callable[[np.ndarray], np.ndarray] | None = None,
        directions: tuple[np.ndarray, np.ndarray] | None = None,
        pressures: Any = (),
        supports: Any = (),
    ) -> Solid:
        space = ELEMENTS[order](mesh)
        fiber, sheet = directions or _frames(mesh.elements)
        mask = np.ones((len(space.points), 3), dtype=bool) if free is None else free(space.points)
        tissue = Tissue(fiber, sheet, list(laws), ActiveShares().tensor(fiber, sheet))
        return Solid(
            space,
            tissue,
            mask,
            [make_load(space) for make_load in pressures],
            [(size, make_load(space)) for size, make_load in supports],
        )

    return make
