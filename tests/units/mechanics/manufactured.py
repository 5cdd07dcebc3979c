"""A manufactured solution: a smooth finite deformation under varying active stress, and the body force it needs."""

import numpy as np
from cardiac_cosim.units.mechanics.kinematics import Kinematics
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.loads.active_stress import ActiveShares

LAWS = (NeoHooke(), HolzapfelFiber())
FIBER, SHEET = np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.0, 1.0])
_AMPLITUDE = np.array([0.06, -0.05, 0.04])


def exact(at: np.ndarray) -> np.ndarray:
    """The displacement in mm at places, shape (points, 3)."""
    x, y, z = at.T
    return (np.sin(np.pi * x) * np.cos(2.0 * y) * np.exp(0.5 * z) + x * y)[:, None] * _AMPLITUDE


def exact_gradient(at: np.ndarray) -> np.ndarray:
    """F, shape (points, 3, 3)."""
    x, y, z = at.T
    grow = np.exp(0.5 * z)
    slope = np.stack(
        [
            np.pi * np.cos(np.pi * x) * np.cos(2.0 * y) * grow + y,
            -2.0 * np.sin(np.pi * x) * np.sin(2.0 * y) * grow + x,
            0.5 * np.sin(np.pi * x) * np.cos(2.0 * y) * grow,
        ],
        axis=1,
    )
    return np.eye(3) + _AMPLITUDE[None, :, None] * slope[:, None, :]


def exact_tension(at: np.ndarray) -> np.ndarray:
    """The active stress in MPa, linear in the place, shape (points,)."""
    return 0.2 * (1.0 + at[:, 0] - 0.5 * at[:, 2])


def nominal_stress(at: np.ndarray) -> np.ndarray:
    """P = F S in MPa, shape (points, 3, 3)."""
    gradient = exact_gradient(at)
    structures = (np.broadcast_to(np.outer(axis, axis), gradient.shape) for axis in (FIBER, SHEET))
    kinematics = Kinematics.of(gradient, np.linalg.det(gradient), *structures)
    active = ActiveShares().tensor(FIBER[None], SHEET[None])
    return gradient @ (sum(law.stress(kinematics) for law in LAWS) + exact_tension(at)[:, None, None] * active)


def body_force(at: np.ndarray) -> np.ndarray:
    """−Div P by central differences of fourth order, which leave errors of 1e-10."""
    force, step = np.zeros_like(at), 2e-3
    for axis in range(3):
        for shift, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
            force -= weight / (12.0 * step) * nominal_stress(at + shift * step * np.eye(3)[axis])[:, :, axis]
    return force
