"""The monodomain equation of the dimensionless potential φ and an ionic model's states on linear elements.

    M dφ/dt = −(K + G) φ + G φ_s + f(φ, states),   dstates/dt = ionic rates

M mass, K diffusion with D = d_iso I + d_ani a₀⊗a₀, G the mass weighted per element with the conductance
G_s max(λ − 1, 0)/β_t, and f the load of the ionic current (docs/model.md, Electrophysiology).

λ is constant per element and enters so: averaged to nodes first, it costs 5 ms of activation time at the apex of a
5 mm mesh. φ_s enters through G's row sums, so that a uniform φ = φ_s is a rest state of the stretch current.

The ionic current is taken at the nodes and interpolated, or integrated by a rule of degree 2 with φ and the states
interpolated to its points, as Galerkin codes commonly do; that is dearer, and no nearer to the speed of fine meshes.
With the lumped mass it is always the former: a lumped mass left of a consistent load makes waves a fifth too fast.

How it fails: both ways of integration make waves too fast on elements that are coarse against the front of 8 mm.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, diags_array, identity

from ..arrays import FloatArray
from ..mesh import Mesh
from ..mesh.finite_elements import diffusion_matrices, interpolation, mass_matrices
from ..mesh.sparsity import Pattern
from ..variable import parameter

#: A time scale in ms by the height Z in mm.
Clock = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Conduction:
    """Conductivity (over C_m χ_m = 1), stretch-activated current, and how the equation is discretised."""

    diffusion_isotropic_mm2_per_ms: float = parameter(1.0, "mm2/ms", "d_iso, isotropic diffusion", at_least=0.0)
    diffusion_anisotropic_mm2_per_ms: float = parameter(
        0.1, "mm2/ms", "d_ani, additional diffusion along the fibre", at_least=0.0
    )
    stretch_conductance: float = parameter(10.0, "1", "G_s, conductance of the stretch-activated current", at_least=0.0)
    stretch_reversal: float = parameter(
        0.6, "1", "phi_s, dimensionless reversal potential of that current", at_least=-100.0, below=100.0
    )
    mass_matrix: str = parameter(
        "consistent",
        "1",
        "consistent: waves are too fast on coarse meshes; lumped: they are too slow",
        choices=("consistent", "lumped"),
    )
    ionic_current: str = parameter(
        "nodal",
        "1",
        "nodal: evaluated at the nodes; quadrature: integrated by a rule of degree 2 (with the consistent mass only)",
        choices=("nodal", "quadrature"),
    )


class Monodomain:
    """The discretised equation on one mesh; a scene of single points has no diffusion, and each point's mass is 1.

    Parameters
    ----------
    mesh, fiber:
        The mesh and the fibre directions a₀, shape (elements, 3).
    time_scale:
        β_t in ms by the height Z in mm.
    conduction:
        The parameters.
    ionic_clock:
        The unit of the ionic model's time in ms by the height; β_t if not given.
    """

    def __init__(
        self, mesh: Mesh, fiber: FloatArray, time_scale: Clock, conduction: Conduction, ionic_clock: Clock | None = None
    ) -> None:
        self.mesh = mesh
        self.reversal = conduction.stretch_reversal
        self.lumped = conduction.mass_matrix == "lumped"
        self.nodal = self.lumped or conduction.ionic_current == "nodal" or mesh.dimension == 0
        self.pattern = Pattern(mesh.cells, mesh.nodes)
        self.mass_values = self._lump(self.pattern.values(mass_matrices(mesh)))
        across, along = conduction.diffusion_isotropic_mm2_per_ms, conduction.diffusion_anisotropic_mm2_per_ms
        conductivity = across * np.eye(3) + along * fiber[:, :, None] * fiber[:, None, :]
        self.diffusion_values = self.pattern.values(diffusion_matrices(mesh, conductivity))
        self._ionic_clock = ionic_clock or time_scale
        #: How much of the ionic model's time passes in a ms at the nodes, shape (nodes,).
        self.node_rate = 1.0 / self._ionic_clock(mesh.points[:, 2])
        #: Conductance of the elements in 1/ms for each unit of stretch beyond 1, shape (elements,).
        self.opening = conduction.stretch_conductance * (1.0 / time_scale(mesh.points[:, 2]))[mesh.cells].mean(axis=1)

    @cached_property
    def mass(self) -> csr_matrix:
        """M in mm³."""
        return self.pattern.csr(self.mass_values)

    @cached_property
    def diffusion(self) -> csr_matrix:
        """K in mm³/ms."""
        return self.pattern.csr(self.diffusion_values)

    @cached_property
    def to_points(self) -> csr_matrix:
        """From nodes to the points at which the ionic current is taken, shape (points, nodes)."""
        return csr_matrix(identity(self.mesh.nodes)) if self.nodal else interpolation(self.mesh)[0]

    @cached_property
    def load(self) -> csr_matrix:
        """From currents at those points to f, shape (nodes, points)."""
        if self.nodal:
            return self.mass
        to_points, weights = interpolation(self.mesh)
        return csr_matrix(to_points.T @ diags_array(weights))

    @cached_property
    def point_rate(self) -> FloatArray:
        """How much of the ionic model's time passes in a ms at those points, shape (points,)."""
        return self.node_rate if self.nodal else 1.0 / self._ionic_clock(self.to_points @ self.mesh.points[:, 2])

    def conductance(self, stretch: FloatArray) -> csr_matrix:
        """G in mm³/ms for the stretches λ of the elements, shape (elements,)."""
        rate = self.opening * np.maximum(stretch - 1.0, 0.0)
        values = self.pattern.values(rate[:, None, None] * self._element_mass)
        return self.pattern.csr(self._lump(values))

    @cached_property
    def _element_mass(self) -> FloatArray:
        return mass_matrices(self.mesh)

    def _lump(self, values: FloatArray) -> FloatArray:
        if not self.lumped:
            return values
        lumped = np.zeros_like(values)
        lumped[self.pattern.diagonal] = self.pattern.csr(values).sum(axis=1).A1
        return lumped
