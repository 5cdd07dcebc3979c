"""Iterated coupling: the sweeps of an explicit scheme, repeated over the same step until the interface has converged.

Units that lie in no loop need no iteration: the loops of the connection graph are found, those upstream step before
them and those downstream after, once. The units of a loop are taken back to the step's begin before every sweep but
the first, which needs their rollback. Before the first step the initial values of a loop are made to agree in the same
way, in initialization mode, where outputs follow inputs without a step.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import NotConverged
from ..participants.participant import Participant, Values
from .acceleration import Acceleration
from .connections import Connection, End
from .convergence import Convergence, Criterion
from .exchange import Exchange
from .loops import Group, groups_in_order, inside
from .norm import norm
from .rollback import Rollback
from .schemes import GaussSeidel, Step, Sweep, Sweeps

#: Change of a field's magnitude by which what an acceleration remembers is of another scale and is forgotten.
_RESCALED = 2.0

#: Contraction rate below which it is only a matter of sweeps.
_SHRINKS = 0.8


@dataclass(frozen=True)
class Limits:
    """When to stop: by the criteria given ("unit.field", at least one in every loop), or the number of sweeps."""

    criteria: Mapping[str, Criterion]
    max_iterations: int
    fail: bool


class Iterated:
    """Wraps an explicit scheme: repeats its sweeps over each loop until all that its units exchange has converged.

    Parameters
    ----------
    scheme:
        Makes one sweep.
    participants, connections:
        What is coupled; the units of a loop have to roll back.
    acceleration:
        Makes the next interface values from the last ones.
    limits:
        When to stop, and whether reaching the limit is an error.
    """

    settles = True

    def __init__(
        self,
        scheme: Sweep,
        participants: Mapping[str, Participant],
        connections: Sequence[Connection],
        acceleration: Acceleration,
        limits: Limits,
    ) -> None:
        self._scheme = scheme
        self._participants = participants
        self._connections = connections
        self._acceleration = acceleration
        self._limits = limits
        self._scales: dict[End, float] = {}
        self._grouped: dict[tuple[str, ...], list[Group]] = {}

    def advance(self, units: Sequence[str], exchange: Exchange, step: Step) -> Sweeps:
        """See Scheme; NotConverged where a loop leaves the numbers, or misses its criteria and that is an error."""
        sweeps = Sweeps()
        for group in self.groups(units):
            if group.is_loop:
                sweeps = self._iterate(group.units, exchange, step, sweeps)
            else:
                self._scheme.advance(group.units, exchange, step)
        return sweeps

    def groups(self, units: Sequence[str]) -> list[Group]:
        """`units` in groups to be stepped one after the other, of which the loops are iterated."""
        order = tuple(units)
        if order not in self._grouped:
            self._grouped[order] = groups_in_order(order, self._moving(order))
        return self._grouped[order]

    def fields(self, loop: Sequence[str]) -> dict[str, bool]:
        """The fields ("unit.field") that the units of a loop exchange in every step, and whether its sweeps carry them.

        Those that are carried have to converge; the others are computed from them in the same sweep.
        """
        links = self._moving(loop)
        carried = self._scheme.carried(loop, links)
        return {str(end): end in carried for end in _sources(links)}

    def solved(self, units: Sequence[str]) -> set[str]:
        """See Scheme: those of all loops."""
        return {name for group in self.groups(units) if group.is_loop for name in self.fields(group.units)}

    def settle(self, group: Sequence[str], exchange: Exchange, complete: Callable[[], None]) -> Sweeps:
        """See Scheme; NotConverged as for a step. Sweeps are those of Gauss–Seidel, whatever makes those of steps."""
        links = inside(group, self._connections)

        def sweep(number: int) -> None:
            for unit in group:
                exchange.feed(unit, initially=True)
                exchange.collect(unit, initially=True)

        # What the units are without each other is where the iteration starts.
        sweep(0)
        settled = self._converged(links, GaussSeidel().carried(group, links), exchange, sweep, Sweeps())
        earlier = {end: exchange.latest(end) for end in _sources(links)}
        complete()
        # There are FMUs whose outputs do not follow their inputs before they leave initialization mode.
        agree = settled.loops[-1].judge(*self._change(earlier, exchange))
        return Sweeps(settled.loops, settled.converged and agree)

    def _iterate(self, group: Sequence[str], exchange: Exchange, step: Step, before: Sweeps) -> Sweeps:
        links = self._moving(group)
        exchange.overwrite({end: exchange.extrapolated(end) for end in _sources(links)})
        with Rollback(self._participants, group) as begin:

            def sweep(number: int) -> None:
                if number > 1:
                    begin.restore()
                self._scheme.advance(group, exchange, step)

            return self._converged(links, self._scheme.carried(group, links), exchange, sweep, before)

    def _converged(
        self,
        links: Sequence[Connection],
        carried: Sequence[End],
        exchange: Exchange,
        sweep: Callable[[int], None],
        before: Sweeps,
    ) -> Sweeps:
        """Repeat `sweep` until what the `links` carry has converged; the history of it is added to those `before`."""
        interface = _sources(links)
        exact = [str(end) for end in interface if not self._is_real(end)]
        # A change comes round by the units whose outputs wait for the next sweep, one unit in a sweep.
        round_sweeps = len({end.unit for end in carried})
        convergence = Convergence(self._limits.criteria, [str(end) for end in carried], exact, round_sweeps)
        # Truth values, whole numbers and texts are taken as they come.
        carried = [end for end in carried if str(end) not in exact]
        self._acceleration.begin()
        for number in range(1, self._limits.max_iterations + 1):
            earlier = {end: exchange.latest(end) for end in interface}
            sweep(number)
            residuals, values = self._change(earlier, exchange)
            if convergence.judge(residuals, values):
                return before.with_loop(convergence, True)
            if number == 1:
                self._rescale({end: values[str(end)] for end in carried})
            if any(residuals[name].any() for name in exact):
                # After an event the loop is another: nothing that was learned of it holds any more.
                self._acceleration.forget()
                continue
            if number < self._limits.max_iterations and carried:
                following = self._accelerated({end: (earlier[end], values[str(end)]) for end in carried})
                if not all(np.isfinite(value).all() for value in following.values()):
                    raise self._failure(convergence, residuals, before)
                exchange.overwrite(following)
        if self._limits.fail:
            raise self._failure(convergence, residuals, before)
        return before.with_loop(convergence, False)

    def memory(self) -> dict[str, Any]:
        """See Scheme: the scales of the fields. What the acceleration kept of earlier steps is discarded."""
        return {"scales": {str(end): np.array(scale) for end, scale in self._scales.items()}}

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See Scheme."""
        scales = memory.get("scales", {})
        known = {link.source for link in self._connections}
        self._scales = {end: float(scales[str(end)]) for end in known if str(end) in scales}

    def _moving(self, units: Sequence[str]) -> list[Connection]:
        """The connections by which `units` feed each other in every step."""
        return [
            link
            for link in inside(units, self._connections)
            if not self._participants[link.source.unit].outputs[link.source.name].fixed
        ]

    def _rescale(self, values: Mapping[End, Values]) -> None:
        """Fields count relative to their magnitude, fixed over a step and renewed when it has changed much."""
        scales = {end: norm(value) or 1.0 for end, value in values.items()}
        known = self._scales
        if any(not 1.0 / _RESCALED < scale / known.get(end, np.inf) < _RESCALED for end, scale in scales.items()):
            self._scales = known | scales
            self._acceleration.forget()

    def _accelerated(self, sweep: Mapping[End, tuple[Values, Values]]) -> dict[End, Values]:
        """The next iterate of the carried values, which are given as before and after the sweep."""
        scale = np.concatenate([np.full(after.size, 1.0 / self._scales[end]) for end, (_, after) in sweep.items()])
        iterate = np.concatenate([before.ravel() for before, _ in sweep.values()]) * scale
        image = np.concatenate([after.ravel() for _, after in sweep.values()]) * scale
        following = self._acceleration.next(iterate, image - iterate) / scale
        ends = np.cumsum([after.size for _, after in sweep.values()])[:-1]
        parts = np.split(following, ends)
        return {end: part.reshape(after.shape) for (end, (_, after)), part in zip(sweep.items(), parts, strict=True)}

    def _failure(
        self,
        convergence: Convergence,
        residuals: Mapping[str, Values],
        before: Sweeps,
    ) -> NotConverged:
        rate = convergence.contraction_rate
        lines = []
        for name in convergence.open() or residuals:
            residual = np.atleast_1d(residuals[name])
            where = np.unravel_index(int(np.abs(residual).argmax()), residual.shape)
            lines.append(
                f"{name} (largest at {self._place(name)} {', '.join(str(int(index)) for index in where)}: "
                f"{residual[where]:.3g}{convergence.growth(name)})"
            )
        return NotConverged(
            f"no convergence in {len(convergence.history)} sweeps: {', '.join(lines)}; "
            + ("" if rate is None else f"the residual changes by a factor of {rate:.3g} per sweep; ")
            + _remedy(rate, len(convergence.history)),
            before.with_loop(convergence, False),
        )

    def _change(self, earlier: Mapping[End, Values], exchange: Exchange) -> tuple[dict[str, Values], dict[str, Values]]:
        """By field ("unit.field"), the residual H(x) − x of what was `earlier`, and what it is now.

        Of values that are no real numbers the residual is 1 where they have changed.
        """
        residuals, values = {}, {}
        for end, before in earlier.items():
            after = exchange.latest(end)
            values[str(end)] = after
            residuals[str(end)] = after - before if self._is_real(end) else np.asarray(before != after, dtype=float)
        return residuals, values

    def _is_real(self, end: End) -> bool:
        return self._participants[end.unit].outputs[end.name].is_real

    def _place(self, name: str) -> str:
        unit, _, output = name.partition(".")
        location = self._participants[unit].outputs[output].location
        return location if location in ("node", "element") else "index"


def _sources(links: Iterable[Connection]) -> list[End]:
    """The outputs that `links` carry, each once."""
    return list(dict.fromkeys(link.source for link in links))


def _remedy(rate: float | None, sweeps: int) -> str:
    if rate is not None and rate < _SHRINKS:
        return f"it converges: raise max_iterations to more than {sweeps}, or loosen the criterion"
    return "try an acceleration (coupling.iterate.acceleration: anderson), a shorter step, or more max_iterations"
