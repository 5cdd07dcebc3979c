"""The front: the points that no other point beats in one of cost and error without being worse in the other."""

from collections.abc import Sequence
from math import isfinite


def on_front(costs: Sequence[float], errors: Sequence[float]) -> list[bool]:
    """For each point, whether it is on the front of `costs` and `errors` (Pareto). Others than finite errors do not."""

    def beats(one: int, other: int) -> bool:
        no_worse = costs[one] <= costs[other] and errors[one] <= errors[other]
        return no_worse and (costs[one] < costs[other] or errors[one] < errors[other])

    counted = [number for number, error in enumerate(errors) if isfinite(error)]
    return [number in counted and not any(beats(other, number) for other in counted) for number in range(len(errors))]
