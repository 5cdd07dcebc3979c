"""The derivative of a unit's output fields with respect to its inputs at its last step: a linear map."""

from typing import Protocol

from .arrays import FloatArray
from .snapshot import State


class Derivative(Protocol):
    """What a unit that has derivatives gives of itself (`differentiable`); the two are each other's transpose."""

    def along(self, changes: State) -> dict[str, FloatArray]:
        """Changes of all output fields for `changes` of all inputs that are not fixed, both ends of a step alike."""

    def back(self, weights: State) -> dict[str, FloatArray]:
        """Gradients by all inputs that are not fixed, of the sum of all output fields times their `weights`."""
