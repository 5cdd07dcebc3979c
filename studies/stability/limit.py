"""Where theory has the limit of stability: the points of a map at which the predicted amplification is 1."""

from collections.abc import Callable, Sequence
from math import exp, floor, inf, isnan, log

import numpy as np
from contourpy import LineType, contour_generator
from scipy.optimize import bisect

from .axis import Axis

#: The amplification at `x` and `y`; None where nothing is predicted.
Amplification = Callable[[float, float], float | None]

#: Steps between two values of the study along x, and values along y, at which the amplification is looked at.
_ALONG_X, _ALONG_Y = 3, 41

#: How exactly a limit is found, relative to the distance of the values between which it lies; of costly theories.
_EXACT, _COARSE = 1e-7, 1e-3

#: What is above 1 by no more than this is not unstable: modes that neither grow nor decay.
_MARGINAL = 1e-9

#: The logarithms of larger amplifications say no more.
_FAR = 50.0


class Limit:
    """The limit on a panel.

    Parameters
    ----------
    x, y:
        Its axes.
    amplification:
        What theory says at any values on them.
    costly:
        Whether that takes long: it is asked for at the values of the study then, and between two of them only as often
        as the limit needs.
    """

    def __init__(self, x: Axis, y: Axis, amplification: Amplification, costly: bool) -> None:
        self._x, self._y = x, y
        self._amplification = amplification
        self._along_x = 1 if costly else _ALONG_X
        self._along_y = 1 if costly else _ALONG_Y
        self._tolerance = _COARSE if costly else _EXACT

    def curves(self) -> list[list[tuple[float, float]]]:
        """The limit as points (x, y) in pieces that hang together; none where an axis is no range of numbers.

        Their corners lie on lines between values that were looked at, each where the amplification is 1 there.
        """
        if min(len(self._x.rising), len(self._y.rising)) < 2:
            return []
        xs, ys = self._x.refined(self._along_x).tolist(), self._y.spread(self._along_y).tolist()
        excess = np.ma.masked_invalid([[self._excess(x, y) for x in xs] for y in ys])
        if excess.mask.all() or not (excess.min() < 0.0 < excess.max()):
            return []
        lines = contour_generator(z=excess, line_type=LineType.Separate).lines(0.0)
        return [[self._corner(xs, ys, float(x), float(y)) for x, y in np.asarray(line)] for line in lines]

    def at(self, x: float) -> list[float]:
        """The values of y at which the limit lies at `x`, from the smallest on."""
        if not self._y.is_numeric or len(self._y.rising) < 2:
            return []
        ys = self._y.spread(self._along_y).tolist()
        values = [self._excess(x, y) for y in ys]
        found = []
        for low, high, below, above in zip(ys, ys[1:], values, values[1:], strict=False):
            if np.isfinite(below) and np.isfinite(above) and (below < 0.0) != (above < 0.0):
                found.append(self._root(self._y, low, high, lambda y: self._excess(x, y)))
        return found

    # --- inside -------------------------------------------------------------------------------------------------------

    def _excess(self, x: float, y: float) -> float:
        """The logarithm of the amplification; NaN where there is none. What is marginal counts as stable."""
        found = self._amplification(x, y)
        if found is None:
            return np.nan
        if found <= 0.0:
            return -_FAR
        size = log(found) if found < inf else _FAR
        return float(np.clip(size - _MARGINAL, -_FAR, _FAR))

    def _corner(self, xs: Sequence[float], ys: Sequence[float], at_x: float, at_y: float) -> tuple[float, float]:
        """The corner of a contour, given in numbers of values, moved along its line to where the limit is exactly."""
        column, row = round(at_x), round(at_y)
        if abs(at_x - column) <= abs(at_y - row):
            x, low = xs[column], min(floor(at_y), len(ys) - 2)
            return x, self._root(self._y, ys[low], ys[low + 1], lambda y: self._excess(x, y))
        y, left = ys[row], min(floor(at_x), len(xs) - 2)
        return self._root(self._x, xs[left], xs[left + 1], lambda x: self._excess(x, y)), y

    def _root(self, axis: Axis, low: float, high: float, excess: Callable[[float], float]) -> float:
        """Where the excess changes its sign between two values; one of them where it does not."""
        begin, end = axis.place(low), axis.place(high)
        below, above = excess(low), excess(high)
        if (below < 0.0) == (above < 0.0):
            return low if abs(below) < abs(above) else high

        def at(part: float) -> float:
            if part in (0.0, 1.0):
                return low if part == 0.0 else high
            place = begin + part * (end - begin)
            return exp(place) if axis.is_geometric else place

        def sign(part: float) -> float:
            # Only the sign is known everywhere: amplifications have kinks and jumps.
            value = excess(at(part))
            return -1.0 if value < 0.0 else 1.0

        if isnan(excess(at(0.5))):
            # Of whole numbers there is nothing between: the line through both says where it is drawn.
            return at(below / (below - above))
        return float(at(bisect(sign, 0.0, 1.0, xtol=self._tolerance, rtol=8.9e-16)))


def nearest(axis: Axis, values: Sequence[float], to: float) -> float | None:
    """The one of `values` that is nearest on the axis; None of none."""
    return min(values, key=lambda value: abs(axis.place(value) - axis.place(to)), default=None)
