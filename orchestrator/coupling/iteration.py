"""Iterated coupling: the sweeps of an explicit scheme, repeated over the same step until the interface stands still.

Units that lie in no loop need no iteration: the loops of the connection graph are found, those upstream step before
them and those downstream after, once. The units of a loop are taken back to the step's begin before every sweep but
the first, which needs their rollback.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np

from ..errors import NotConverged
from ..participants.participant import Participant, Values
from .acceleration import Acceleration
from .connections import Connection, End
from .convergence import Convergence, Criterion
from .exchange import Exchange
from .rollback import Rollback
from .schemes import Step, Sweep, Sweeps

#: Change of a field's magnitude by which what an acceleration remembers is of another scale and is forgotten.
_RESCALED = 2.0

#: Contraction rate below which it is only a matter of sweeps.
_SHRINKS = 0.8


@dataclass(frozen=True)
class Limits:
    """When to stop: a criterion per converged field ("unit.field"), or the number of sweeps."""

    criteria: Mapping[str, Criterion]
    max_iterations: int
    fail: bool


class Iterated:
    """Wraps an explicit scheme: repeats its sweeps over each loop until the criteria are met.

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
        self._grouped: dict[tuple[str, ...], list[tuple[list[str], bool]]] = {}

    def advance(self, units: Sequence[str], exchange: Exchange, step: Step) -> Sweeps:
        """See Scheme; NotConverged where a loop leaves the numbers, or misses its criteria and that is an error."""
        histories, converged = [], True
        order = tuple(units)
        if order not in self._grouped:
            self._grouped[order] = self.groups(order)
        for group, is_loop in self._grouped[order]:
            if is_loop:
                history, found = self._iterate(group, exchange, step)
                histories.append(history)
                converged = converged and found
            else:
                self._scheme.advance(group, exchange, step)
        return Sweeps(tuple(histories), converged)

    def groups(self, units: Sequence[str]) -> list[tuple[list[str], bool]]:
        """`units` in groups to be stepped one after the other, each in the order given, and whether it is a loop."""
        graph = nx.DiGraph()
        graph.add_nodes_from(units)
        links = [(link.source.unit, link.target.unit) for link in self._connections]
        graph.add_edges_from((source, target) for source, target in links if source in units and target in units)
        loops = nx.condensation(graph)
        place = {unit: number for number, unit in enumerate(units)}
        order = nx.lexicographical_topological_sort(
            loops, key=lambda number: min(place[unit] for unit in loops.nodes[number]["members"])
        )
        members = [sorted(loops.nodes[number]["members"], key=place.__getitem__) for number in order]
        return [(group, len(group) > 1 or graph.has_edge(group[0], group[0])) for group in members]

    def _iterate(self, group: Sequence[str], exchange: Exchange, step: Step) -> tuple[Convergence, bool]:
        inside = self._inside(group)
        interface = list(dict.fromkeys(link.source for link in inside))
        carried = self._scheme.carried(group, inside)
        convergence = Convergence(
            {str(end): self._limits.criteria[str(end)] for end in interface if str(end) in self._limits.criteria}
        )
        self._acceleration.begin()
        exchange.overwrite({end: exchange.foretold(end) for end in interface})
        with Rollback(self._participants, group) as begin:
            for sweep in range(1, self._limits.max_iterations + 1):
                if sweep > 1:
                    begin.restore()
                before = {end: exchange.latest(end) for end in interface}
                self._scheme.advance(group, exchange, step)
                after = {end: exchange.latest(end) for end in interface}
                residuals = {str(end): after[end] - before[end] for end in interface}
                values = {str(end): after[end] for end in interface}
                if convergence.judge(residuals, values):
                    return convergence, True
                if sweep == 1:
                    self._rescale({end: after[end] for end in carried})
                if sweep < self._limits.max_iterations:
                    following = self._accelerated({end: (before[end], after[end]) for end in carried})
                    if not all(np.isfinite(value).all() for value in following.values()):
                        raise NotConverged(self._explain(convergence, values, residuals))
                    exchange.overwrite(following)
        if self._limits.fail:
            raise NotConverged(self._explain(convergence, values, residuals))
        return convergence, False

    def memory(self) -> dict[str, Any]:
        """See Scheme: the scales of the fields. What the acceleration keeps of earlier steps is learned anew."""
        return {"scales": {str(end): np.array(scale) for end, scale in self._scales.items()}}

    def resume(self, memory: Mapping[str, Any]) -> None:
        """See Scheme."""
        scales = memory.get("scales", {})
        known = {link.source for link in self._connections}
        self._scales = {end: float(scales[str(end)]) for end in known if str(end) in scales}

    def _inside(self, group: Sequence[str]) -> list[Connection]:
        """The connections by which the units of a loop feed each other in every step."""
        return [
            link
            for link in self._connections
            if link.source.unit in group
            and link.target.unit in group
            and not self._participants[link.source.unit].outputs[link.source.name].fixed
        ]

    def _rescale(self, values: Mapping[End, Values]) -> None:
        """Fields count relative to their magnitude, fixed over a step and renewed when it has changed much."""
        scales = {end: float(np.linalg.norm(value)) or 1.0 for end, value in values.items()}
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

    def _explain(self, convergence: Convergence, values: Mapping[str, Values], residuals: Mapping[str, Values]) -> str:
        rate = convergence.contraction_rate
        lines = []
        for name in convergence.open(values):
            residual = np.atleast_1d(residuals[name])
            where = np.unravel_index(int(np.abs(residual).argmax()), residual.shape)
            lines.append(
                f"{name} (largest at {self._place(name)} {', '.join(str(int(index)) for index in where)}: "
                f"{residual[where]:.3g}{convergence.growth(name)})"
            )
        return (
            f"no convergence in {len(convergence.history)} sweeps: {', '.join(lines)}; "
            + ("" if rate is None else f"the residual changes by a factor of {rate:.3g} per sweep; ")
            + _remedy(rate, len(convergence.history))
        )

    def _place(self, name: str) -> str:
        unit, _, output = name.partition(".")
        location = self._participants[unit].outputs[output].location
        return location if location in ("node", "element") else "index"


def _remedy(rate: float | None, sweeps: int) -> str:
    if rate is not None and rate < _SHRINKS:
        return f"it converges: raise max_iterations to more than {sweeps}, or loosen the criterion"
    return "try an acceleration (coupling.iterate.acceleration: anderson), a shorter step, or more max_iterations"
