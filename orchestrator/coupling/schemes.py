"""Explicit coupling schemes: in which order the units step, and which values they see.

Under Jacobi no unit knows what the others compute in this step, so that all can step at the same time; under
Gauss–Seidel a unit knows what the units before it in the order have just computed for the step's end. What is not known
is extrapolated (`exchange`). With held inputs both are of first order in the step; with ramped ones and an
extrapolation of order 1, of second.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from .connections import Connection, End
from .convergence import Convergence
from .exchange import Exchange

#: Steps units, by name, at the same time as far as they can.
Step = Callable[[Sequence[str]], None]


@dataclass(frozen=True)
class Sweeps:
    """How a step went: the histories of its loops, where it was iterated.

    `converged` is what the criteria say of the last sweeps, never inferred from the number of sweeps.
    """

    loops: tuple[Convergence, ...] = ()
    converged: bool = True

    def with_loop(self, loop: Convergence, converged: bool) -> "Sweeps":
        """The same with the history of one more loop, and whether that has converged."""
        return Sweeps((*self.loops, loop), self.converged and converged)

    @property
    def iterations(self) -> int:
        """Sweeps over the loop that needed most of them."""
        return max((len(loop.history) for loop in self.loops), default=1)

    @property
    def residuals(self) -> dict[str, float]:
        """Norm of each field's residual after the last sweep."""
        return {name: norm for loop in self.loops for name, norm in loop.history[-1].items()}

    @property
    def contraction_rate(self) -> float | None:
        """Factor by which the residual shrank per sweep where that was slowest; None where one sweep was enough."""
        rates = [loop.contraction_rate for loop in self.loops]
        return max((rate for rate in rates if rate is not None), default=None)


class Scheme(Protocol):
    """Advances all units by one communication step."""

    #: Whether it makes the initial values of a loop agree; if not, inputs that close a loop have their start values.
    settles: bool

    def advance(self, units: Sequence[str], exchange: Exchange, step: Step) -> Sweeps:
        """Step `units`, and leave their new outputs in `exchange`."""

    def settle(self, group: Sequence[str], exchange: Exchange, complete: Callable[[], None]) -> Sweeps:
        """Make the initial values of a loop agree, if it `settles`: its units are in initialization mode.

        `complete` lets them leave it, and collects their outputs.
        """

    def solved(self, units: Sequence[str]) -> set[str]:
        """The fields ("unit.field") that `units` exchange in loops which it solves in every step."""

    def memory(self) -> dict[str, Any]:
        """What it has learned, for a checkpoint."""

    def resume(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""


class Sweep(Scheme, Protocol):
    """A scheme that steps every unit once, and can therefore be repeated until the exchanged values have converged."""

    def carried(self, units: Sequence[str], links: Sequence[Connection]) -> list[End]:
        """The outputs of `units`, connected by `links`, whose values before a sweep decide its outcome."""


class _Explicit:
    """Explicit schemes learn nothing, and take initial values as they come."""

    settles = False

    def settle(self, group: Sequence[str], exchange: Exchange, complete: Callable[[], None]) -> Sweeps:
        """See Scheme."""
        complete()
        return Sweeps()

    def solved(self, units: Sequence[str]) -> set[str]:
        """See Scheme: none."""
        return set()

    def memory(self) -> dict[str, Any]:
        """See Scheme."""
        return {}

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See Scheme."""


class Jacobi(_Explicit):
    """All units step at once, from what is known at the step's begin."""

    def advance(self, units: Sequence[str], exchange: Exchange, step: Step) -> Sweeps:
        """See Scheme; the order of `units` makes no difference."""
        for unit in units:
            exchange.feed(unit)
        step(units)
        for unit in units:
            exchange.collect(unit)
        return Sweeps()

    def carried(self, units: Sequence[str], links: Sequence[Connection]) -> list[End]:
        """See Sweep: all of them."""
        return list(dict.fromkeys(link.source for link in links))


class GaussSeidel(_Explicit):
    """Each unit steps with the newest values there are."""

    def advance(self, units: Sequence[str], exchange: Exchange, step: Step) -> Sweeps:
        """See Scheme; `units` is the order."""
        for unit in units:
            exchange.feed(unit)
            step([unit])
            exchange.collect(unit)
        return Sweeps()

    def carried(self, units: Sequence[str], links: Sequence[Connection]) -> list[End]:
        """See Sweep: those that a unit reads which comes before, or is, the unit that writes them."""
        back = [link.source for link in links if units.index(link.target.unit) <= units.index(link.source.unit)]
        return list(dict.fromkeys(back))


SCHEMES: dict[str, type[Sweep]] = {"jacobi": Jacobi, "gauss-seidel": GaussSeidel}
