"""The factor by which a linear system grows from one exchange to the next, fitted from its time series.

Dynamic mode decomposition (Schmid 2010, J. Fluid Mech. 656, 5-28, section 2.3): the linear map that takes each row to
the next one is found by least squares on the singular vectors of the rows, and its eigenvalues are the factors z of the
modes. Three things beside let it be exact for a coupled run of linear units:

- Rows are put together with one or two rows before them (delays): units and extrapolation remember exchanges that the
  time series does not show at the same time.
- Where a constant load moves the rest position, z = 1 would be found for it, so that differences of rows are fitted as
  well, which have the same modes without that one.
- Each pair of rows is divided by its size, which a linear map allows. Without that a run that grows by two hundred
  orders of magnitude would be its last rows only, and one that decays its first ones.

The simplest fit that leaves nothing but rounding is taken. A time series that none fits is of no linear recurrence.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees

import numpy as np
from scipy.linalg import eig

from ...orchestrator.participants.participant import Values

#: The first rows are of a run that has no history yet, and still extrapolates to a lower order.
_STARTING = 3

#: Rows before that are put together with a row.
_DELAYS = (0, 1, 2)

#: Singular values below this, relative to the largest, are rounding.
_RANK = 1e-12

#: How far above the rounding of the rows a singular value has to be to say something.
_ABOVE = 1e4

#: What is left of the fit says how wrong a factor may be to first order; what its rank leaves out, is not in it.
_SAFETY = 30.0

#: Relative misfit that is rounding, and the largest with which a time series counts as a linear recurrence.
_EXACT, _LINEAR = 1e-11, 1e-6

#: Rows beyond these are near the end of the numbers, in either direction.
_LARGEST, _SMALLEST = 1e290, 1e-290

#: How far two steps may be apart, relative to them, and still be equal.
_EQUAL = 1e-6

#: What is above 1 by no more than this neither grows nor decays.
_MARGINAL = 1e-9

#: Turn of the phase per exchange from which a mode counts as alternating: six exchanges in a period.
_ALTERNATES_DEG = 60.0

#: Distance of a factor from 1 within which it may be the rest position's.
_REST = 1e-5


@dataclass(frozen=True)
class Modes:
    """The dominant mode: `radius` is its factor per step, `angle_deg` by how much its phase turns, from 0 to 180.

    The radius is known to within `doubt`: a short run says little of slow modes. Where nothing could be fitted `radius`
    is None, and `why` says so.
    """

    radius: float | None
    doubt: float = 0.0
    angle_deg: float = 0.0
    why: str = ""

    @property
    def grows(self) -> bool:
        """Whether it does beyond doubt."""
        return self.radius is not None and self.radius - self.doubt > 1.0 + _MARGINAL

    @property
    def alternates(self) -> bool:
        """Whether its phase turns so much from one exchange to the next that no unit of its own would do that."""
        return self.angle_deg >= _ALTERNATES_DEG


@dataclass(frozen=True)
class _Fit:
    factors: Values
    #: By how much each of the factors may be wrong.
    doubts: Values
    misfit: float
    #: Whether the misfit is rounding.
    exact: bool

    @property
    def rests(self) -> bool:
        """Whether one of the modes may be a rest position, which does not change."""
        return bool((np.abs(self.factors - 1.0) < _REST).any())


def fitted_modes(columns: Mapping[str, Values]) -> Modes:
    """The dominant mode of a time series, `columns` by name as `StoredRun.columns` has them, `time_ms` among them."""
    time = columns.get("time_ms", np.empty(0))
    moving = [values for name, values in columns.items() if name != "time_ms" and _moves(values)]
    if not moving:
        return Modes(None, why="nothing in its time series moves, so no modes can be fitted")
    rows = np.column_stack(moving)
    beyond = (np.abs(np.nan_to_num(rows)) > _LARGEST).any(axis=1)
    end = int(beyond.argmax()) if beyond.any() else len(rows)
    # Units that step less often leave gaps.
    known = np.isfinite(rows[:end]).all(axis=1)
    time, rows = time[:end][known], rows[:end][known]
    steps = np.diff(time)
    if len(steps) and np.ptp(steps) > _EQUAL * steps.max():
        return Modes(None, why="its steps differ, so no modes can be fitted")
    rows = rows[_STARTING:]
    # Columns of every size count alike.
    rows = rows / np.where(np.abs(rows).max(axis=0, initial=0.0) > 0.0, np.abs(rows).max(axis=0, initial=0.0), 1.0)
    sizes = np.abs(rows).max(axis=1, initial=0.0)
    best: _Fit | None = None
    for delays in _DELAYS:
        fit = _fit(rows, sizes, delays)
        if fit is None or fit.rests:
            fit = _fit(np.diff(rows, axis=0), np.maximum(sizes[1:], sizes[:-1]), delays) or fit
        if fit is not None and (best is None or fit.misfit < best.misfit):
            best = fit
        if best is not None and best.exact:
            break
    if best is None:
        return Modes(None, why="its time series is too short for modes to be fitted")
    if best.misfit > _LINEAR:
        return Modes(
            None,
            why=f"its time series is not a linear recurrence (misfit {best.misfit:.1g}), so no modes can be fitted",
        )
    return _dominant(best)


def _moves(values: Values) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 1 and bool(np.any(known != known[0]))


def _fit(rows: Values, sizes: Values, delays: int) -> _Fit | None:
    """The factors of all modes from rows, each with so many before it; None where there are too few.

    `sizes` are those of the numbers that the rows were computed from, whose rounding they carry.
    """
    count = len(rows) - delays
    used = np.flatnonzero(sizes > _SMALLEST)
    count = min(count, int(used[-1]) + 1 - delays if len(used) else 0)
    if count - 1 <= rows.shape[1] * (delays + 1):
        return None
    states = np.hstack([rows[delays - back : delays - back + count] for back in range(delays + 1)])
    size = sizes[delays : delays + count - 1, None]
    # A row may pass through zero.
    size = np.where(size > 0.0, size, 1.0)
    before, after = states[:-1] / size, states[1:] / size
    scale = np.linalg.norm(before, axis=0)
    scale[scale == 0.0] = 1.0
    noise = float(np.finfo(float).eps / np.abs(before).max())
    before, after = before / scale, after / scale
    left, lengths, right = np.linalg.svd(before, full_matrices=False)
    kept = lengths > max(_RANK, _ABOVE * noise) * lengths[0]
    left, lengths, right = left[:, kept], lengths[kept], right[kept]
    # Rows are states: the map is after = before @ M, in coordinates of the kept right singular vectors.
    solved = (left.T @ after) / lengths[:, None]
    residual = np.abs(after - (left * lengths) @ solved).max()
    misfit = float(residual / np.abs(after).max())
    factors, rows_of, columns_of = eig(solved @ right.T, left=True, right=True)
    # To first order in what the fit leaves, which is divided by the singular values.
    turned = np.abs((rows_of.conj() * columns_of).sum(axis=0))
    doubts = (
        _SAFETY
        * residual
        * np.linalg.norm(rows_of / lengths[:, None], axis=0)
        / np.maximum(turned, np.finfo(float).tiny)
    )
    return _Fit(factors, doubts, misfit, misfit <= _EXACT + _ABOVE * noise)


def _dominant(fit: _Fit) -> Modes:
    which = int(np.abs(fit.factors).argmax())
    largest = fit.factors[which]
    return Modes(float(np.abs(largest)), float(fit.doubts[which]), abs(degrees(np.angle(largest))))
