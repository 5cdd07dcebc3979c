"""What a passive law is: a strain energy W of the deformation and of the directions of fibre and sheet."""

from typing import ClassVar, Protocol

from ...arrays import FloatArray
from ..kinematics import Kinematics


class Law(Protocol):
    """A hyperelastic law, a frozen dataclass of its parameters; laws add up.

    A law that has a twin in C (`kernels/laws/`, under the same `name`) hands it its `constants`, eight at the most;
    without one NumPy computes everything in the solid that has it.
    """

    name: ClassVar[str]

    @property
    def modulus(self) -> float:
        """How stiff it is against shear when undeformed, in MPa: what residual forces are measured by."""

    def constants(self) -> tuple[float, ...]:
        """The numbers that the twin in C needs."""

    def energy(self, at: Kinematics) -> FloatArray:
        """W in MPa, shape (points,)."""

    def stress(self, at: Kinematics) -> FloatArray:
        """The second Piola–Kirchhoff stress S = 2∂W/∂C in MPa, shape (points, 3, 3)."""

    def tangent(self, at: Kinematics) -> FloatArray:
        """4∂²W/∂C² in MPa, Voigt notation, shape (points, 6, 6)."""
