"""The discretised solid: energy, out-of-balance forces and stiffness of tissue under its loads.

A solid is put together of parts that know nothing of each other: elements (`elements`), passive laws (`laws`), active
stress and surface loads (`loads`). All but the active stiffness have a potential, so that an equilibrium is the minimum
of an energy.

What changes from step to step is the vector of loads: the active stress at the mesh's nodes, then a size for every
variable surface load, all in MPa. The vector may go on with the active stiffness at the nodes in MPa and the stretch of
each element at which the active stress holds (`loads/active_stiffness`).
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ..arrays import FloatArray, IntArray
from .bulk import NumpyBulk, Tissue
from .compiled_bulk import bulk
from .elements.space import Space
from .kinematics import Kinematics, determinant, square
from .loads.active_stiffness import ActiveStiffness, StretchDependence
from .loads.surface_load import SurfaceLoad
from .stiffness import Stiffness, StiffnessPattern


class Solid:
    """Tissue under loads.

    Parameters
    ----------
    space:
        The displacement's nodes and elements.
    tissue:
        Directions, passive laws and active stress.
    free:
        Which degrees of freedom are free, shape (nodes, 3); the others do not move.
    pressures:
        Surface loads whose sizes are part of the loads.
    supports:
        Surface loads of fixed size, in MPa.
    """

    def __init__(
        self,
        space: Space,
        tissue: Tissue,
        free: np.ndarray,
        pressures: Sequence[SurfaceLoad] = (),
        supports: Sequence[tuple[float, SurfaceLoad]] = (),
    ) -> None:
        self.space, self.free = space, free
        self._tissue = tissue
        self._pressures, self._supports = pressures, supports
        self._pattern = StiffnessPattern(space.nodes, free)
        self._bulk = bulk(space, tissue, self._pattern)
        self._places = np.flatnonzero(free)
        self._vertices = int(space.nodes[:, :4].max()) + 1
        self.unknowns = len(self._places)
        #: How many loads there are, active stiffness and the stretch of elements apart: shape (loads,).
        self.loads = self._vertices + len(pressures)

    @property
    def compiled(self) -> bool:
        """Whether compiled kernels compute it, and not NumPy."""
        return not isinstance(self._bulk, NumpyBulk)

    @cached_property
    def active_stiffness(self) -> ActiveStiffness:
        """The active stress by its dependence on the stretch."""
        return ActiveStiffness(self.space, self._tissue.fiber)

    def is_symmetric(self, loads: FloatArray) -> bool:
        """Whether the tangent is the residual's whole derivative, and the energy its potential: no active stiffness."""
        return self.dependence(loads) is None

    def held(self, displacement: FloatArray, loads: FloatArray) -> FloatArray:
        """Loads with the active stress that there is, held while the solid deforms further; shape (loads,)."""
        tension = self._tension(displacement, loads)
        return np.concatenate([tension, loads[self._vertices : self.loads]])

    def active_forces(self, displacement: FloatArray) -> csr_matrix:
        """Derivative of the residual by the active stress at the vertices, in N/MPa, shape (unknowns, vertices)."""
        blocks = self._numpy.active_forces(displacement)
        degrees = 3 * self.space.nodes[:, :, None, None] + np.arange(3)[:, None]
        rows, columns = np.broadcast_arrays(degrees, self.space.nodes[:, None, None, :4])
        shape = (self.free.size, self._vertices)
        return coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape).tocsr()[self._places]

    def pressure_forces(self, displacement: FloatArray) -> FloatArray:
        """Derivative of the residual by the sizes of the surface loads, in N/MPa, shape (pressures, unknowns)."""
        forces = [load.forces(displacement).reshape(-1)[self._places] for load in self._pressures]
        return np.reshape(forces, (len(forces), self.unknowns))

    def stretch_gradient(self, displacement: FloatArray) -> csr_matrix:
        """Derivative of the stretch by the free degrees of freedom, in 1/mm, shape (elements, unknowns)."""
        blocks = self.active_stiffness.stretch_gradient(displacement)
        degrees = 3 * self.space.nodes[:, :, None] + np.arange(3)
        elements = np.broadcast_to(np.arange(len(blocks))[:, None, None], blocks.shape)
        shape = (len(blocks), self.free.size)
        return coo_matrix((blocks.ravel(), (elements.ravel(), degrees.ravel())), shape).tocsr()[:, self._places]

    def selection(self) -> csr_matrix:
        """From the free degrees of freedom to all, those of a node together, shape (3 nodes, unknowns)."""
        ones = np.ones(self.unknowns)
        return csr_matrix((ones, (self._places, np.arange(self.unknowns))), (self.free.size, self.unknowns))

    def moved(self, displacement: FloatArray, step: FloatArray) -> FloatArray:
        """A new displacement, shape (nodes, 3): the free degrees of freedom moved by `step`, shape (unknowns,)."""
        result = displacement.copy()
        result.reshape(-1)[self._places] += step
        return result

    def stretch(self, displacement: FloatArray) -> FloatArray:
        """λ = √(a₀·C a₀), shape (elements,)."""
        return self._bulk.stretch(displacement)

    def volume_ratio(self, displacement: FloatArray) -> FloatArray:
        """J = det F, its smallest value in each element, shape (elements,)."""
        ratio = determinant(self._numpy.gradient(displacement))
        return np.asarray(ratio.reshape(len(self.space.nodes), -1).min(axis=1))

    def reference_stress(self) -> float:
        """Largest component of the passive stress in the undeformed solid, in MPa; zero for a sound material."""
        fiber, sheet = square(self._tissue.fiber), square(self._tissue.sheet)
        at = Kinematics.of(np.broadcast_to(np.eye(3), fiber.shape), np.ones(len(fiber)), fiber, sheet)
        return float(np.abs(sum(law.stress(at) for law in self._tissue.laws)).max())

    def energy(self, displacement: FloatArray, loads: FloatArray) -> float:
        """Total potential energy in N mm, where there is one; infinite where an element is inverted."""
        return self.energy_and_residual(displacement, loads)[0]

    def residual(self, displacement: FloatArray, loads: FloatArray) -> FloatArray | None:
        """Out-of-balance force in N at the free degrees of freedom; None where an element is inverted."""
        found = self._bulk.forces(displacement, self._tension(displacement, loads), False)
        return None if found is None else self._reduced(found[1], displacement, loads)

    def energy_and_residual(self, displacement: FloatArray, loads: FloatArray) -> tuple[float, FloatArray]:
        """Both at once; they share the kinematics. Infinite and NaN where an element is inverted.

        Where the loads are not symmetric (`is_symmetric`) there is no energy, and the number says no more than whether
        an element is inverted.
        """
        found = self._bulk.forces(displacement, self._tension(displacement, loads), True)
        if found is None:
            return np.inf, np.full(self.unknowns, np.nan)
        energy = found[0] + sum(size * load.energy(displacement) for size, load in self._on_surfaces(loads))
        return energy, self._reduced(found[1], displacement, loads)

    def tangent(self, displacement: FloatArray, loads: FloatArray) -> Stiffness:
        """Derivative of the residual by the free degrees of freedom, in N/mm. Needs det F > 0.

        Of the active stiffness the part that is symmetric (`loads/active_stiffness`).
        """
        blocks = self._bulk.stiffness(displacement, self._tension(displacement, loads))
        dependence = self.dependence(loads)
        if dependence is not None:
            self._pattern.add(blocks, self._pattern.slots, self.active_stiffness.stiffness(displacement, dependence))
        for size, load in self._on_surfaces(loads):
            self._pattern.add(blocks, self._slots_of(load), size * load.stiffness(displacement))
        return Stiffness(self._pattern, blocks)

    def _reduced(self, forces: FloatArray, displacement: FloatArray, loads: FloatArray) -> FloatArray:
        for size, load in self._on_surfaces(loads):
            forces += size * load.forces(displacement)
        return forces.reshape(-1)[self._places]

    def _on_surfaces(self, loads: FloatArray) -> list[tuple[float, SurfaceLoad]]:
        """Surface loads that are there, with their sizes; one of size 0 costs nothing."""
        sized = zip(loads[self._vertices : self.loads].tolist(), self._pressures, strict=True)
        return [*self._supports, *((size, load) for size, load in sized if size)]

    def _tension(self, displacement: FloatArray, loads: FloatArray) -> FloatArray:
        """The active stress at the vertices, with what it gains by the stretch, shape (vertices,)."""
        tension, dependence = loads[: self._vertices], self.dependence(loads)
        if dependence is None:
            return tension
        return tension + self.active_stiffness.stress(self.stretch(displacement), dependence)

    def dependence(self, loads: FloatArray) -> StretchDependence | None:
        """How the active stress depends on the stretch; None where it does not."""
        stiffness = loads[self.loads : self.loads + self._vertices]
        return StretchDependence(stiffness, loads[self.loads + self._vertices :]) if stiffness.any() else None

    def _slots_of(self, load: SurfaceLoad) -> IntArray:
        if id(load) not in self._load_slots:
            self._load_slots[id(load)] = self._pattern.slots_of(load.nodes)
        return self._load_slots[id(load)]

    @cached_property
    def _load_slots(self) -> dict[int, IntArray]:
        return {}

    @cached_property
    def _numpy(self) -> NumpyBulk:
        return self._bulk if isinstance(self._bulk, NumpyBulk) else NumpyBulk(self.space, self._tissue, self._pattern)
