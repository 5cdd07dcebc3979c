"""Richardson's estimate with the observed order, and when it is refused."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, log, nan

from .source import BASE, COARSER, FINER, FINEST

#: Differences below this part of the value are those of sums in another order, not of a method.
_ROUND_OFF = 1e-9

#: With the order 1/2 the estimate is twice the difference to the run at FINEST, if the ratio is 2.
_LOWEST_ORDER = 0.5

#: How far an order that only three runs show may be from a whole number; where they are the finest, below one.
_CLEAR = 0.25

#: By which factor the estimates of two triplets of runs may differ.
_AGREEMENT = 1.5


@dataclass(frozen=True)
class Estimate:
    """The `error` of a value, positive where the value is too large, and the observed `order` of accuracy if any.

    Where it is not `trusted` the reason is given, and the error is the difference to the finest run, as an indication
    (NaN where there is none). It is `negligible` where all differences are round-off.
    """

    error: float
    order: float | None
    trusted: bool
    reason: str = ""
    negligible: bool = False

    @property
    def is_settled(self) -> bool:
        """Whether a finer run would add nothing."""
        return self.trusted or self.negligible


def richardson(values: Mapping[int, float], ratio: float, highest_order: float) -> Estimate:
    """The error of the value at BASE, from the `values` at the levels that are known; BASE and FINER have to be.

    `ratio` is that of what the order is meant in, from one level to the next. Where there is a value at FINEST the
    order is that of the three finest values, and the estimate from the coarser ones has to agree; else the order
    comes from the three coarsest and has to be near a whole number. See Roache, Annu. Rev. Fluid Mech. 29 (1997).
    """
    indication = values[BASE] - values[max(values)]
    if not all(isfinite(value) for value in values.values()):
        return Estimate(nan, None, False, "a value is not finite")
    noise = _ROUND_OFF * max(abs(value) for value in values.values())
    apart = {level: values[level] - values[level + 1] for level in sorted(values) if level + 1 in values}
    if all(abs(difference) <= noise for level, difference in apart.items() if level >= BASE):
        return Estimate(indication, None, False, f"negligible: below round-off, {noise:.1g}", True)
    if FINEST in values:
        order, why = _order(apart[BASE], apart[FINER], ratio, highest_order, noise)
        if COARSER in values:
            why = why or _disagreement(apart[COARSER], apart[BASE], apart[FINER])
        elif order is not None and order < 1.0 - _CLEAR:
            why = why or f"the observed order {order:.2g} is low, and there is no coarser run to confirm it"
    elif COARSER in values:
        order, why = _order(apart[COARSER], apart[BASE], ratio, highest_order, noise)
        if order is not None and abs(order - max(1, round(order))) > _CLEAR:
            why = (
                why or f"the observed order {order:.2g} is not a whole number, and there is no finer run to confirm it"
            )
    else:
        order, why = None, "two runs do not show the order"
    if why or order is None:
        return Estimate(indication, order, False, why)
    return Estimate(apart[BASE] / (1.0 - ratio**-order), order, True)


def _order(before: float, after: float, ratio: float, highest: float, noise: float) -> tuple[float | None, str]:
    """The order from two differences of successive values, if there is one, and why it is not to be trusted, if so."""
    pair = f"{_told(before)}, then {_told(after)}"
    if abs(after) <= noise:
        return None, f"the differences fall to round-off at once ({pair}), faster than any order of accuracy predicts"
    if before * after <= 0.0:
        return None, f"the values change back and forth as they are refined ({pair}), outside the asymptotic range"
    if abs(after) >= abs(before):
        return None, f"the differences do not shrink as they are refined ({pair}), outside the asymptotic range"
    order = log(before / after) / log(ratio)
    if order < _LOWEST_ORDER:
        return order, f"the differences hardly shrink ({pair}), outside the asymptotic range"
    if order > highest:
        return order, f"the differences shrink faster than the method can converge ({pair}), which is chance"
    return order, ""


def _disagreement(before: float, middle: float, after: float) -> str:
    """Why the estimates from the coarser and from the finer two of three differences disagree, if they do."""
    # Either estimate is a geometric sum of differences that begins with the middle one.
    if before * middle <= 0.0 or abs(middle) >= abs(before):
        return f"the coarser run shows no order ({_told(before)}, then {_told(middle)}), outside the asymptotic range"
    coarse, fine = middle / (1.0 - middle / before), middle / (1.0 - after / middle)
    if max(coarse / fine, fine / coarse) > _AGREEMENT:
        return f"the coarser runs give {_told(coarse)} and the finer ones {_told(fine)}, outside the asymptotic range"
    return ""


def _told(number: float) -> str:
    return f"{number:.2g}"
