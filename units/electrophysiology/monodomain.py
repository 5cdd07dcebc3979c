"""The monodomain equation of the dimensionless potential φ and recovery r on linear elements, and its step in time.

    M dφ/dt = −(K + G) φ + G φ_s + f(φ, r),   dr/dt = g(φ, r)/β_t

M mass, K diffusion with D = d_iso I + d_ani a₀⊗a₀, G the mass weighted per element with the conductance
G_s max(λ − 1, 0)/β_t, and f the load of the ionic current −Ĩ_e/β_t (model.md, Electrophysiology).

λ is constant per element and enters so: averaged to nodes first, it costs 5 ms of activation time at the apex of a
5 mm mesh. φ_s enters through G's row sums, so that a uniform φ = φ_s is a rest state of the stretch current.

The ionic current is taken at the nodes and interpolated, or integrated by a rule of degree 2 with φ and r interpolated
to its points, as Galerkin codes commonly do; that is dearer, and no nearer to the speed of fine meshes. With the lumped
mass it is always the former: a lumped mass left of a consistent load makes waves a fifth too fast.

How it fails: both ways of integration make waves too fast on elements that are coarse against the front of 8 mm.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags_array, identity
from scipy.sparse.linalg import LinearOperator, cg
from skfem import BilinearForm
from skfem.helpers import dot, grad, mul

from ..arrays import FloatArray
from ..errors import StepFailure
from ..mesh import Mesh
from ..mesh.finite_elements import interpolation, linear_basis
from ..mesh.sparsity import Pattern
from ..variable import parameter

#: Dimensionless rates ∂φ/∂τ and ∂r/∂τ of an ionic model at points of equal number.
Rates = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

#: Residual to which the systems of a step are solved, relative to their right-hand sides.
_SOLVER_TOLERANCE = 1e-11
_SOLVER_ITERATIONS = 1000

#: The implicit-explicit method (2,2,2) of Ascher, Ruuth & Spiteri 1997, section 2.6: second order, L-stable.
_GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
_DELTA = 1.0 - 1.0 / (2.0 * _GAMMA)


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
        "consistent: waves too fast on coarse meshes; lumped: too slow",
        choices=("consistent", "lumped"),
    )
    ionic_current: str = parameter(
        "nodal",
        "1",
        "nodal: taken at the nodes; quadrature: integrated by a rule of degree 2 (with the consistent mass only)",
        choices=("nodal", "quadrature"),
    )


@BilinearForm
def _mass(u, v, w):  # type: ignore[no-untyped-def]
    return u * v


@BilinearForm
def _diffusion(u, v, w):  # type: ignore[no-untyped-def]
    return dot(mul(w.D, grad(u)), grad(v))


def _operators(mesh: Mesh, fiber: FloatArray, conduction: Conduction) -> tuple[csr_matrix, csr_matrix]:
    """Mass and diffusion; a scene of single points has no diffusion, and each point's mass is 1."""
    if mesh.dimension == 0:
        return csr_matrix(identity(mesh.nodes)), csr_matrix((mesh.nodes, mesh.nodes))
    basis = linear_basis(mesh)
    across, along = conduction.diffusion_isotropic_mm2_per_ms, conduction.diffusion_anisotropic_mm2_per_ms
    conductivity = across * np.eye(3) + along * fiber[:, :, None] * fiber[:, None, :]
    inside = conductivity[:, : mesh.dimension, : mesh.dimension].transpose(1, 2, 0)[..., None]
    at_points = np.broadcast_to(inside, (*inside.shape[:3], len(basis.W)))
    return csr_matrix(_mass.assemble(basis)), csr_matrix(_diffusion.assemble(basis, D=at_points))


class Monodomain:
    """The discretised equation on one mesh.

    Parameters
    ----------
    mesh, fiber:
        The mesh and the fibre directions a₀, shape (elements, 3).
    time_scale:
        β_t in ms by the height Z in mm.
    conduction:
        The parameters.
    """

    def __init__(
        self, mesh: Mesh, fiber: FloatArray, time_scale: Callable[[FloatArray], FloatArray], conduction: Conduction
    ) -> None:
        self._conduction = conduction
        self._lumped = conduction.mass_matrix == "lumped"
        mass, self._diffusion = _operators(mesh, fiber, conduction)
        self.mass = self._lump(mass) if self._lumped else mass
        self.node_rate = 1.0 / time_scale(mesh.points[:, 2])
        if self._lumped or conduction.ionic_current == "nodal" or mesh.dimension == 0:
            self.to_points, self.load = csr_matrix(identity(mesh.nodes)), self.mass
            self.point_rate = self.node_rate
        else:
            self.to_points, weights = interpolation(linear_basis(mesh))
            self.load = csr_matrix(self.to_points.T @ diags_array(weights))
            self.point_rate = 1.0 / time_scale(self.to_points @ mesh.points[:, 2])
        self._pattern = Pattern(mesh.cells, mesh.nodes)
        corners = mesh.dimension + 1
        # Of linear simplices: |e| (1 + δ_ab)/((d + 1)(d + 2)).
        self._element_mass = mesh.volumes[:, None, None] * (np.ones((corners, corners)) + np.eye(corners))
        self._element_mass /= corners * (corners + 1)
        self._element_rate = self.node_rate[mesh.cells].mean(axis=1)

    def conductance(self, stretch: FloatArray) -> csr_matrix:
        """G in mm³/ms for the stretches λ of the elements, shape (elements,)."""
        rate = self._conduction.stretch_conductance * np.maximum(stretch - 1.0, 0.0) * self._element_rate
        matrix = self._pattern.matrix(rate[:, None, None] * self._element_mass)
        return self._lump(matrix) if self._lumped else matrix

    def stepper(self, stretch: FloatArray, step: float, rates: Rates) -> "MonodomainStep":
        """The step of `step` ms while the stretch is held, with the ionic model `rates`."""
        conductance = self.conductance(stretch)
        source = self._conduction.stretch_reversal * np.asarray(conductance.sum(axis=1)).ravel()
        return MonodomainStep(self, csr_matrix(self._diffusion + conductance), source, step, rates)

    @staticmethod
    def _lump(matrix: csr_matrix) -> csr_matrix:
        return csr_matrix(diags_array(np.asarray(matrix.sum(axis=1)).ravel()))


class MonodomainStep:
    """A second-order step, implicit in A = K + G and explicit in the ionic model: slivers' fast modes decay."""

    def __init__(
        self, equation: Monodomain, operator: csr_matrix, source: FloatArray, step: float, rates: Rates
    ) -> None:
        self._equation = equation
        self._operator = operator
        self._source = source
        self._step = step
        self._rates = rates
        self._matrix = csr_matrix(equation.mass + _GAMMA * step * operator)
        inverse_diagonal = 1.0 / self._matrix.diagonal()
        self._preconditioner = LinearOperator(self._matrix.shape, matvec=lambda residual: inverse_diagonal * residual)

    def __call__(self, phi: FloatArray, recovery: FloatArray) -> tuple[FloatArray, FloatArray]:
        """φ and r a step later, shape (nodes,) both; StepFailure if a linear system is not solved."""
        step, implicit = self._step, _GAMMA * self._step
        inertia = self._equation.mass @ phi
        load1, rate1 = self._explicit(phi, recovery)
        middle = self._solve(inertia + implicit * (load1 + self._source), phi)
        load2, rate2 = self._explicit(middle, recovery + implicit * rate1)
        linear = self._source - self._operator @ middle
        forces = _DELTA * load1 + (1.0 - _DELTA) * load2 + (1.0 - _GAMMA) * linear + _GAMMA * self._source
        return (
            self._solve(inertia + step * forces, middle),
            recovery + step * (_DELTA * rate1 + (1.0 - _DELTA) * rate2),
        )

    def _explicit(self, phi: FloatArray, recovery: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The load f of the ionic current, and dr/dt, both at the nodes."""
        equation = self._equation
        at_points, _ = self._rates(equation.to_points @ phi, equation.to_points @ recovery)
        _, at_nodes = self._rates(phi, recovery)
        return equation.load @ (equation.point_rate * at_points), equation.node_rate * at_nodes

    def _solve(self, right: FloatArray, guess: FloatArray) -> FloatArray:
        solution, failed = cg(
            self._matrix,
            right,
            x0=guess,
            rtol=_SOLVER_TOLERANCE,
            atol=0.0,
            maxiter=_SOLVER_ITERATIONS,
            M=self._preconditioner,
        )
        if failed:
            raise StepFailure(
                f"a step of the potential was not solved in {_SOLVER_ITERATIONS} iterations of conjugate gradients; "
                "look for degenerate elements in the mesh or take a smaller longest_substep_ms"
            )
        return np.asarray(solution)
