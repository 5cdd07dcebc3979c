"""The report on fields that alternate from step to step: the cause according to theory, and what helps.

In a loop of units that respond without delay, with the gain g, an error is multiplied by z at every exchange, with

    1 = g E(z)ᵐ,   E(z) = 1 − (1 − 1/z)^{p+1},

where m of the values that go round are not known yet when they are used and are extrapolated, by polynomials of order p
whose own amplification is E: one under Gauss–Seidel in the order of the loop, all under Jacobi. With held values
(p = 0) that is z = g and zᵐ = g. A rate |z| and a period that were measured so tell the gain.
"""

import cmath
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi

from ..participants.participant import Participant
from .alternation import DECAYING, GROWING, Alternation
from .connections import Connection, End
from .loops import Group, groups_in_order
from .schemes import GaussSeidel, Jacobi, Scheme

#: Under this name units give, and take, the derivative of what they exchange, which makes an explicit loop stable.
_STABILISER = "active_stiffness"


@dataclass(frozen=True)
class _Circle:
    """A closed way through a loop, `waiting` of whose values are used before they are known."""

    links: Sequence[Connection]
    waiting: int

    def __str__(self) -> str:
        return " -> ".join([*(link.source.unit for link in self.links), self.links[0].source.unit])


class Diagnosis:
    """Of a coupling of `participants`, stepped in the order of `units`, unknown inputs `extrapolated` by that order."""

    def __init__(
        self,
        participants: Mapping[str, Participant],
        connections: Sequence[Connection],
        units: Sequence[str],
        scheme: Scheme,
        extrapolated: int,
    ) -> None:
        self._participants = participants
        self._units = units
        self._scheme = scheme
        self._extrapolated = extrapolated
        # What is exchanged once closes no loop.
        self._links = [link for link in connections if not self._is_fixed(link)]

    def announced(self, name: str, found: Alternation) -> str:
        """One line on the field `name` ("unit.field") that has begun to grow."""
        circle = self._circle(self._end(name), found)
        where = "in no loop" if circle is None else f"in the loop {circle}"
        return (
            f"{name} alternates with a period of {found.period_steps} steps and has grown by a factor of "
            f"{found.rate:.3g} per step since {found.from_ms:g} ms; it is exchanged {where}"
        )

    def paragraphs(self, found: Mapping[str, Alternation]) -> list[str]:
        """The report on alternating fields, a paragraph for each loop; those that decay are left out."""
        alive = {self._end(name): each for name, each in found.items() if each.kind != DECAYING}
        told = []
        for group in groups_in_order(self._units, self._links):
            fields = {end: each for end, each in alive.items() if end.unit in group.units}
            # What is fed by a field that alternates follows it.
            if fields and (group.is_loop or self._sources(group).isdisjoint(end.unit for end in alive)):
                told.append(self._paragraph(fields))
        return told

    # --- inside -------------------------------------------------------------------------------------------------------

    def _paragraph(self, fields: Mapping[End, Alternation]) -> str:
        leader = next(iter(fields))
        for end, each in fields.items():
            leader = end if each.worse_than(fields[leader]) else leader
        found, circle = fields[leader], self._circle(leader, fields[leader])
        others = ", ".join(str(end) for end in fields if end != leader)
        grows = found.kind == GROWING
        rate = f"grows by a factor of {found.rate:.3g}" if grows else f"keeps {found.rate:.0%} of its amplitude"
        what = (
            f"{leader} alternates from exchange to exchange with a period of {found.period_steps}, and {rate} at each, "
            f"from {found.from_ms:g} to {found.to_ms:g} ms; at the end its amplitude is {found.share:.1%} of its range"
            + (f"; the same holds for {others}" if others else "")
        )
        return ". ".join([what, *self._reasons(leader, found, circle)])

    def _reasons(self, leader: End, found: Alternation, circle: _Circle | None) -> list[str]:
        """Why it does, and what helps."""
        if circle is None:
            return [
                f"It is exchanged in no loop, so unit '{leader.unit}' alternates by itself, as explicit methods "
                "do when their steps are too long: take shorter steps, inside that unit or by coupling.step_ms"
            ]
        if not isinstance(self._scheme, GaussSeidel | Jacobi):
            return [
                f"Its loop, {circle}, is iterated: the criteria of coupling.iterate.converge are too loose for it, or "
                "the units alternate themselves; tighten the criteria, or take shorter steps"
            ]
        gain, limit = (self._gain(rate, found.period_steps, circle) for rate in (found.rate, 1.0))
        power = "" if circle.waiting == 1 else f" to the power of {circle.waiting}"
        relation = (
            f"|g| is that factor{power}"
            if self._extrapolated == 0
            else f"and the extrapolation of order {self._extrapolated} enlarges it"
        )
        return [
            f"It is exchanged in the loop {circle}, which is coupled explicitly: its gain g multiplies an error in "
            f"every round, {relation}",
            f"If all its units respond without delay, |g| is about {gain:.3g} here, errors grow where it is above "
            f"{limit:.3g}, and no step is short enough; if one of them has memory, a shorter or a longer step may help",
            f"What helps: {'; or '.join(self._remedies(leader, circle, gain))}",
        ]

    def _gain(self, rate: float, period: int, circle: _Circle) -> float:
        """|g| of the loop if its units respond without delay; see the module."""
        factor = rate * cmath.exp(2j * pi / period)
        return float(abs(1.0 - (1.0 - 1.0 / factor) ** (self._extrapolated + 1)) ** -circle.waiting)

    def _remedies(self, leader: End, circle: _Circle, gain: float) -> list[str]:
        units = [link.source.unit for link in circle.links]
        remedies = []
        if all(self._participants[unit].abilities.rolls_back for unit in units):
            remedies.append(
                "coupling.iterate with `acceleration: anderson` and "
                f"`converge: {{{leader}: {{relative: 1e-4}}}}`, which solves the loop in every step"
            )
        if self._extrapolated > 0 and gain < 1.0:
            remedies.append("coupling.extrapolation: 0, with which errors grow only above |g| = 1")
        fed = {link.target for link in self._links}
        givers = [unit for unit in units if _STABILISER in self._participants[unit].outputs]
        for unit in units:
            port = self._participants[unit].inputs.get(_STABILISER)
            if port is not None and givers and End(unit, _STABILISER) not in fed:
                live = port.live or port.needs is None
                needs = "" if live else f" and the parameter {port.needs} of unit '{unit}'"
                remedies.append(
                    f"the connection {givers[0]}.{_STABILISER} -> {unit}.{_STABILISER}{needs}, which stabilise"
                    f"{'s' if live else ''} the explicit loop"
                )
        return remedies or [
            "another split of the units, because one of them cannot roll back and the loop cannot be iterated"
        ]

    def _circle(self, end: End, found: Alternation) -> _Circle | None:
        """The shortest closed way that a value of `end` goes, with as many unknown values as fit its period."""
        circles = [
            self._counted([link, *way])
            for link in self._links
            if link.source == end and (way := self._way(link.target.unit, end.unit)) is not None
        ]
        lag = found.period_steps // 2
        return min(circles, key=lambda circle: (circle.waiting != lag, len(circle.links)), default=None)

    def _way(self, begin: str, end: str) -> list[Connection] | None:
        """The fewest connections from unit to unit; None if there is no way."""
        ways: dict[str, list[Connection]] = {begin: []}
        for unit in (queue := [begin]):
            for link in self._links:
                if link.source.unit == unit and link.target.unit not in ways:
                    ways[link.target.unit] = [*ways[unit], link]
                    queue.append(link.target.unit)
        return ways.get(end)

    def _counted(self, links: Sequence[Connection]) -> _Circle:
        if not isinstance(self._scheme, GaussSeidel | Jacobi):
            return _Circle(links, 0)
        carried = self._scheme.carried(self._units, links)
        return _Circle(links, sum(link.source in carried for link in links))

    def _sources(self, group: Group) -> set[str]:
        """The units outside of a group that feed it, directly or by others."""
        found = set(group.units)
        while more := {link.source.unit for link in self._links if link.target.unit in found} - found:
            found |= more
        return found - set(group.units)

    def _is_fixed(self, link: Connection) -> bool:
        source = self._participants[link.source.unit].outputs[link.source.name]
        return source.fixed or self._participants[link.target.unit].inputs[link.target.name].fixed

    def _end(self, name: str) -> End:
        return next(link.source for link in self._links if str(link.source) == name)
