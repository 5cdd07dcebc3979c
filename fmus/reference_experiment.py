"""The reference experiment of a unit: its inputs, and the results of the unit without FMI, which users can repeat.

Parameters keep their defaults, and directions their start values. Every other input that matters by itself, without
a parameter that it `needs`, is raised at the start and stays so: a number by one in its unit of measure, of a field the
first places only. What stays constant is the same to a master that holds inputs and to one that interpolates them, and
few places are few columns. The answers are the scalar outputs; of a unit that has none, the first places of its fields.

On large meshes there is none, since an equilibrium there takes longer than all else that makes the FMU.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import prod

import numpy as np

from ..units.arrays import FloatArray
from ..units.errors import InvalidInput, StepFailure
from ..units.mesh import Mesh
from ..units.unit import Unit
from ..units.variable import Causality, Variable
from .layout import scalar_names

#: Communication step, and how many.
_STEP_MS, _STEPS = 1, 5

#: Elements of a mesh above which it is large; the shipped heart has 5592.
_LARGE = 20_000

#: How much inputs rise, in their unit of measure; stretches, which are pure numbers on the mesh, by a tenth.
_RISE, _RISE_OF_RATIO = 1.0, 0.1

#: Places of a field that rise, and that are given as answers by a unit without scalar outputs.
_PLACES = 8

#: What processors and linear solvers may make of the same unit, relative to the largest value of each answer.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class ReferenceExperiment:
    """Communication points in s, constant inputs by name (in their declared shapes), and answers at every point.

    `answers` are scalars by name, elements of fields among them, each of shape (times,).
    """

    times_s: tuple[float, ...]
    inputs: Mapping[str, FloatArray]
    answers: Mapping[str, FloatArray]

    @property
    def step_s(self) -> float:
        """The communication step."""
        return self.times_s[1]


def reference_experiment(kind: type[Unit], mesh: Mesh) -> ReferenceExperiment | None:
    """The reference experiment of a unit of this `kind` on `mesh`, run here.

    None on a large mesh, and where the unit has no initial state with default parameters, as without a stimulus.
    """
    if mesh.elements > _LARGE:
        return None
    inputs = {item.name: _raised(item, mesh) for item in _driven(kind)}
    times = tuple(number * _STEP_MS / 1000 for number in range(_STEPS + 1))
    unit = kind(mesh)
    try:
        return ReferenceExperiment(times, inputs, _answers(unit, times, inputs))
    except (InvalidInput, StepFailure):
        return None


def driven_places(variable: Variable, mesh: Mesh) -> int:
    """How many values of an input, in row-major order, rise."""
    return min(_PLACES * variable.components, prod(variable.shape(mesh)))


def _driven(kind: type[Unit]) -> Iterator[Variable]:
    return (item for item in kind.inputs() if not item.fixed and item.needs is None)


def _raised(variable: Variable, mesh: Mesh) -> FloatArray:
    values = np.full(variable.shape(mesh), float(variable.start))
    is_ratio = variable.unit == "1" and bool(values.shape)
    values.reshape(-1)[: driven_places(variable, mesh)] += _RISE_OF_RATIO if is_ratio else _RISE
    return values


def _answers(unit: Unit, times: tuple[float, ...], inputs: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    unit.instantiate({})
    unit.setup_experiment()
    unit.enter_initialization_mode()
    for name, values in inputs.items():
        unit.set(name, values)
    unit.exit_initialization_mode()
    rows = [_row(unit)]
    for begin, end in pairwise(times):
        unit.do_step(begin, end - begin)
        rows.append(_row(unit))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _row(unit: Unit) -> dict[str, float]:
    outputs = [item for item in unit.variables() if item.causality is Causality.OUTPUT]
    scalars = {item.name: float(unit.get(item.name)) for item in outputs if not item.shape(unit.mesh)}
    if scalars:
        return scalars
    row: dict[str, float] = {}
    for item in outputs:
        values = np.asarray(unit.get(item.name)).reshape(-1)[: driven_places(item, unit.mesh)]
        # The generator of names ends later than the values.
        row |= dict(zip(scalar_names(item.name, item.shape(unit.mesh)), values.tolist(), strict=False))
    return row
