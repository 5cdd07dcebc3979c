"""The derivative of a unit of a few numbers: its matrix."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..snapshot import State


@dataclass(frozen=True)
class ScalarDerivative:
    """See Derivative; `slopes` are those of each output by each input."""

    slopes: Mapping[str, Mapping[str, float]]

    def along(self, changes: State) -> dict[str, FloatArray]:
        """See Derivative."""
        return {
            name: np.asarray(sum(slope * changes[given] for given, slope in row.items()))
            for name, row in self.slopes.items()
        }

    def back(self, weights: State) -> dict[str, FloatArray]:
        """See Derivative."""
        inputs = next(iter(self.slopes.values()))
        return {
            given: np.asarray(sum(row[given] * weights[name] for name, row in self.slopes.items())) for given in inputs
        }
