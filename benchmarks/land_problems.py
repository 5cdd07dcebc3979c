"""The two passive problems of Land et al. 2015 (Proc. R. Soc. A 471:20150641) on structured meshes.

Problem 1: a beam of 10 x 1 x 1 mm with fibres along it, fixed at x = 0. A pressure of 4 Pa acts on its lower face and
follows the face as it deforms.
Problem 2: half an ellipsoid, isotropic, fixed at its base, under a pressure of 10 kPa inside. Because of the symmetry,
a quarter of it is computed.
"""

import numpy as np
from cardiac_cosim.units.arrays import FloatArray
from cardiac_cosim.units.mechanics.bulk import Tissue
from cardiac_cosim.units.mechanics.elements.registry import ELEMENTS
from cardiac_cosim.units.mechanics.elements.space import Space
from cardiac_cosim.units.mechanics.laws.guccione import Guccione
from cardiac_cosim.units.mechanics.loads.cavity_pressure import CavityPressure
from cardiac_cosim.units.mechanics.solid import Solid
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver
from cardiac_cosim.units.mechanics.solvers.equilibrium import Convergence, Equilibrium
from cardiac_cosim.units.mechanics.solvers.factored import Factored
from cardiac_cosim.units.mesh import Mesh
from skfem import MeshTet

#: Penalty on changes of volume in MPa; doubling it moves the tip by 3 μm and the apex by 5 μm (docs/mechanics.md).
BULK_MPA = 0.5

#: Problem 2: the pressure, and the parameters of the law.
ELLIPSOID_LOAD_KPA = 10.0
ELLIPSOID_LAW = {
    "guccione_stiffness_MPa": 0.01,
    "guccione_fiber": 1.0,
    "guccione_transverse": 1.0,
    "guccione_shear": 1.0,
}

_MPA_PER_KPA = 1e-3
_BEAM_LOAD_MPA = 4e-6
_TIP = (10.0, 0.5, 1.0)
#: Semi-axes (short, long) inside and outside, and the height of the base, in mm.
_INNER, _OUTER, _BASE_MM = (7.0, 17.0), (10.0, 20.0), 5.0


def beam(across: int) -> Mesh:
    """Problem 1 with a number of cells across and twenty times as many along, denser where it is fixed; `loaded`."""
    side = np.linspace(0.0, 1.0, across + 1)
    points, cells = _grid(10.0 * np.linspace(0.0, 1.0, 20 * across + 1) ** 1.5, side, side)
    surface = Mesh(points, cells).surface
    return Mesh(points, cells, {"loaded": surface[(points[surface, 2] == 0.0).all(axis=1)]})


def tip_mm(mesh: Mesh, order: int, bulk_MPa: float = BULK_MPA) -> float:
    """Problem 1: the height in mm of the tip, (10, 0.5, 1), which an even number of cells across has as a node of P1.

    The rim of the face moves, so that the load has no potential.
    """
    law = Guccione(guccione_bulk_modulus_MPa=bulk_MPa)
    space = ELEMENTS[order](mesh)
    fixed = np.repeat(space.points[:, :1] == 0.0, 3, axis=1)
    return _height(space, _equilibrium(space, mesh, law, fixed, "loaded", _BEAM_LOAD_MPA), _TIP)


def ellipsoid(through: int, quarters: int = 1) -> Mesh:
    """Problem 2, from x > 0 and y > 0 on, with a number of cells through the wall.

    There are eight times as many cells from apex to base, and four times as many around each of its `quarters`. Its
    boundaries are `lv_endocardium`, `epicardium` and `base`.
    """
    axes = (np.linspace(0.0, 1.0, count + 1) for count in (through, 8 * through, 4 * through * quarters))
    grid, cells = _grid(*axes)
    surface = Mesh(grid, cells).surface
    sides = {"lv_endocardium": (0, 0.0), "epicardium": (0, 1.0), "base": (1, 1.0)}
    faces = {name: surface[(grid[surface, axis] == end).all(axis=1)] for name, (axis, end) in sides.items()}
    wall, up, around = grid.T
    short, long = (inside + wall * (outside - inside) for inside, outside in zip(_INNER, _OUTER, strict=True))
    angle = np.pi + (np.arccos(_BASE_MM / long) - np.pi) * up
    radius = short * np.sin(angle)
    turn = 0.5 * np.pi * quarters * around
    moved = np.stack([radius * np.cos(turn), radius * np.sin(turn), long * np.cos(angle)], axis=1)
    # On the planes of symmetry and in that of the base to the bit; rings of nodes at the apex become one node each.
    moved[np.abs(moved) < 1e-9] = 0.0
    moved[up == 1.0, 2] = _BASE_MM
    _, first, numbers = np.unique(np.round(moved, 9), axis=0, return_index=True, return_inverse=True)
    points, numbers = moved[first], numbers.ravel()
    cells = _upright(points, _with_distinct_nodes(numbers[cells]))
    return Mesh(points, cells, {name: _with_distinct_nodes(numbers[side]) for name, side in faces.items()})


def apex_mm(mesh: Mesh, order: int, bulk_MPa: float = BULK_MPA, through: float = 0.5) -> float:
    """Problem 2: the height in mm of the apex, by default in the middle of the wall, a node of P1 where cells are even.

    `through` is 0 inside and 1 outside.
    """
    law = Guccione(**ELLIPSOID_LAW, guccione_bulk_modulus_MPa=bulk_MPa)
    space = ELEMENTS[order](mesh)
    fixed = space.points == 0.0
    fixed[:, 2] = False
    fixed[space.points[:, 2] == _BASE_MM] = True
    displacement = _equilibrium(space, mesh, law, fixed, "lv_endocardium", _MPA_PER_KPA * ELLIPSOID_LOAD_KPA)
    return _height(space, displacement, (0.0, 0.0, -_INNER[1] - through * (_OUTER[1] - _INNER[1])))


def _equilibrium(
    space: Space, mesh: Mesh, law: Guccione, fixed: np.ndarray, boundary: str, load_MPa: float
) -> FloatArray:
    """The displacement under a pressure on `boundary`, put on at once."""
    along = np.tile([1.0, 0.0, 0.0], (mesh.elements, 1))
    across = np.tile([0.0, 0.0, 1.0], (mesh.elements, 1))
    tissue = Tissue(along, across, [law], np.zeros((mesh.elements, 3, 3)))
    solid = Solid(space, tissue, ~fixed, [CavityPressure(space, mesh.boundary(boundary))])
    equilibrium = Equilibrium(
        solid,
        law.modulus * float(mesh.volumes.mean()) ** (2.0 / 3.0),
        Convergence(newton_iterations=100),
        LinearSolver().factorisation(solid),
    )
    rest, unloaded = np.zeros_like(space.points), np.zeros(solid.loads)
    loads = unloaded.copy()
    loads[-1] = load_MPa
    return equilibrium.solve(rest, rest, unloaded, loads, Factored(rest, unloaded)).displacement


def _height(space: Space, displacement: FloatArray, at: tuple[float, float, float]) -> float:
    node = int(np.linalg.norm(space.points - at, axis=1).argmin())
    if not np.allclose(space.points[node], at, rtol=0.0, atol=1e-9):
        raise ValueError(f"no node at {at}: the number of cells has to be even with P1")
    return float(space.points[node, 2] + displacement[node, 2])


def _grid(*axes: FloatArray) -> tuple[FloatArray, np.ndarray]:
    grid = MeshTet.init_tensor(*axes)
    points = grid.p.T.copy()
    return points, _upright(points, grid.t.T.copy())


def _upright(points: FloatArray, cells: np.ndarray) -> np.ndarray:
    inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0.0
    cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    return cells


def _with_distinct_nodes(simplices: np.ndarray) -> np.ndarray:
    return simplices[(np.diff(np.sort(simplices, axis=1), axis=1) != 0).all(axis=1)]
