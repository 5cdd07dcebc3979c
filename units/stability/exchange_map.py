"""What an explicit coupling does to linear units from one exchange to the next, as one matrix.

Units of which the step is linear in their state and inputs, coupled without iteration in steps of one length, are a
linear recurrence: of their states, and of their outputs at the last exchanges, from which unknown inputs are
extrapolated. Its spectral radius is the factor by which the slowest disturbance grows or decays per exchange.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..errors import InvalidInput
from .theory import Coupled

#: Weights of the last values, the newest first, in the polynomial that extrapolates to the next one, by its order.
_EXTRAPOLATION = ((1.0,), (2.0, -1.0), (3.0, -3.0, 1.0))


@dataclass(frozen=True)
class Seen:
    """How a unit sees its inputs in a step, arrays of shape (inputs, columns).

    They run from `begin` to `end` with a second derivative that is `bend` over the square of the step.
    """

    begin: FloatArray
    end: FloatArray
    bend: FloatArray


@dataclass(frozen=True)
class LinearUnit:
    """A unit of which the step is linear.

    Parameters
    ----------
    states:
        How many numbers its state has.
    outputs:
        How many outputs.
    inputs:
        What feeds each of its inputs: a unit's name and which of its outputs.
    step:
        From the state, shape (states, columns), and the inputs as they are seen to the state at the step's end and the
        outputs there, shape (outputs, columns). The columns are independent of each other.
    bends:
        Whether it follows a parabola inside a step, and not a line only.
    """

    states: int
    outputs: int
    inputs: tuple[tuple[str, int], ...]
    step: Callable[[FloatArray, Seen], tuple[FloatArray, FloatArray]]
    bends: bool = False


def exchange_map(units: Mapping[str, LinearUnit], coupled: Coupled) -> FloatArray:
    """The matrix that takes one exchange to the next; `units` in the order in which they step.

    It is of the states of all units, in order, then of all outputs at the last exchange, at the one before, and so on,
    as many as the extrapolation takes.

    InvalidInput for an order of extrapolation beyond 2.
    """
    if not 0 <= coupled.extrapolation < len(_EXTRAPOLATION):
        raise InvalidInput(f"the theory knows extrapolation of orders 0, 1 and 2, not {coupled.extrapolation}")
    weights = _EXTRAPOLATION[coupled.extrapolation]
    state_count = sum(unit.states for unit in units.values())
    output_count = sum(unit.outputs for unit in units.values())
    size = state_count + len(weights) * output_count
    columns = np.eye(size)
    states = dict(_parts(columns[:state_count], {name: unit.states for name, unit in units.items()}))
    past = [
        dict(_parts(values, {name: unit.outputs for name, unit in units.items()}))
        for values in np.split(columns[state_count:], len(weights))
    ]
    known: dict[str, FloatArray] = {}
    after: dict[str, FloatArray] = {}
    outputs: dict[str, FloatArray] = {}
    for name, unit in units.items():
        after[name], outputs[name] = unit.step(states[name], _seen(unit, coupled, weights, past, known, size))
        if not coupled.jacobi:
            known[name] = outputs[name]
    rows = [*after.values(), *outputs.values(), *(values for moment in past[:-1] for values in moment.values())]
    return np.vstack(rows)


def spectral_radius(matrix: FloatArray) -> float:
    """The largest modulus of an eigenvalue; infinite for a matrix that is not finite."""
    return float(np.abs(np.linalg.eigvals(matrix)).max()) if np.isfinite(matrix).all() else np.inf


def _seen(
    unit: LinearUnit,
    coupled: Coupled,
    weights: tuple[float, ...],
    past: list[dict[str, FloatArray]],
    known: Mapping[str, FloatArray],
    size: int,
) -> Seen:
    begin, end, bend = (np.zeros((len(unit.inputs), size)) for _ in range(3))
    for row, (source, place) in enumerate(unit.inputs):
        if source in known:
            end[row] = known[source][place]
        else:
            end[row] = sum(weight * moment[source][place] for weight, moment in zip(weights, past, strict=True))
            if unit.bends and len(past) > 2:
                bend[row] = past[0][source][place] - 2.0 * past[1][source][place] + past[2][source][place]
        begin[row] = past[0][source][place]
    return Seen(begin, end, bend) if coupled.linear else Seen(end, end, np.zeros_like(bend))


def _parts(values: FloatArray, counts: Mapping[str, int]) -> list[tuple[str, FloatArray]]:
    ends = np.cumsum([*counts.values()])
    return list(zip(counts, np.split(values, ends[:-1]), strict=True))
