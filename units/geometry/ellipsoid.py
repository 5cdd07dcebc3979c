"""Exact volumes of pieces of concentric, axis-parallel ellipsoids (docs/model.md, Geometry)."""

import math

import numpy as np

from ..arrays import FloatArray

#: Semi-axes along x, y and z, mm.
SemiAxes = tuple[float, float, float]

# Gauss–Legendre points over the half circle of directions; the integrand is smooth, 64 reach rounding.
_QUADRATURE_POINTS = 64


def level(axes: SemiAxes, points: FloatArray) -> FloatArray:
    """Where `points` (n, 3) lie: 0 on the ellipsoid, negative inside, positive outside; dimensionless, shape (n,)."""
    return np.asarray(np.linalg.norm(points / np.array(axes), axis=1) - 1.0)


def half_ellipsoid_volume(axes: SemiAxes) -> float:
    """Volume in mm³ of the part with Z < 0: 2/3 π a b c."""
    return 2.0 / 3.0 * math.pi * math.prod(axes)


def half_shell_volume(outer: SemiAxes, wall: float) -> float:
    """Volume in mm³ with Z < 0 between an ellipsoid and the one whose semi-axes are shorter by `wall` mm."""
    return half_ellipsoid_volume(outer) - half_ellipsoid_volume(shrunk(outer, wall))


def shrunk(axes: SemiAxes, wall: float) -> SemiAxes:
    """The semi-axes shorter by `wall` mm each."""
    return (axes[0] - wall, axes[1] - wall, axes[2] - wall)


def crescent_volume(axes: SemiAxes, core: SemiAxes) -> float:
    """Volume in mm³ inside the ellipsoid `axes`, outside the ellipsoid `core`, with X > 0 and Z < 0.

    `axes` must be longer than `core` along x and at most as long along y and z. The directions (1, u, v) in which
    `axes` reaches further than `core` then fill a cone p > q u² + r v². With u = ρ cos ψ, v = −ρ sin ψ the volume
    under either surface is ⅓ ∫∫ (1/a² + ρ² β(ψ))^(−3/2) ρ dρ dψ, β = cos²ψ/b² + sin²ψ/c²; the integral over ρ is
    closed, the one over ψ from 0 to π is left to Gauss's quadrature.
    """
    p, q, r = np.array([1.0, -1.0, -1.0]) * (1.0 / np.square(core) - 1.0 / np.square(axes))
    if p <= 0.0 or q < 0.0 or r < 0.0 or q + r == 0.0:
        raise ValueError(
            f"{axes} must be longer than {core} along x, at most as long along y and z, and not both equal"
        )
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_POINTS)
    ψ = 0.5 * math.pi * (nodes + 1.0)
    cos2, sin2 = np.cos(ψ) ** 2, np.sin(ψ) ** 2
    rim = p / (q * cos2 + r * sin2)

    def under(surface: SemiAxes) -> FloatArray:
        a, b, c = surface
        β = cos2 / b**2 + sin2 / c**2
        return np.asarray((a - 1.0 / np.sqrt(1.0 / a**2 + β * rim)) / β)

    return float(0.5 * math.pi * weights @ (under(axes) - under(core)) / 3.0)
