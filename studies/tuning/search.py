"""The search for the cheapest candidate that keeps all tolerances, by as few runs as certainty allows.

Candidates of one group are ordered by how finely they compute: one that is nowhere coarser than another and somewhere
finer costs no less, except that a longer communication step may be the dearer one; so along the coupling the cost has
to have begun to rise. From that alone follows most of what need not be run:

- a candidate that is finer than one that keeps the tolerances, for it costs more than that one;
- a candidate that is finer than one that costs more than the best so far, whether that one keeps them or not.

So the cheap, coarse ones are run first. The third reason is about errors. Candidates may follow a *lead*: the one that
differs from them only in what matters little unless the lead is nearly good enough. If that one misses a tolerance by
more than a factor, those that follow it are not run.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from math import inf

#: Costs nearer than this to each other are taken for equal: seconds of a machine repeat themselves no better.
NOISE = 0.1

#: How the coordinates of the coupling begin: communication step, tolerance of adaptive steps or of an iteration.
_COUPLING = ("coupling", "iterate")

#: Coordinates by name, the names in order.
Coupling = tuple[tuple[str, float], ...]

#: By what factor a lead may miss a tolerance, so that those that follow it are still run.
_NEARLY = 3.0


@dataclass(frozen=True)
class Candidate:
    """A candidate as the search sees it.

    `name` is for reasons. Candidates of one `group` are ordered by their `coordinates`, which grow as a setting becomes
    finer and dearer. Those of a lower `phase` come first; `leads` are the names of those that it follows.
    """

    name: str
    group: Hashable
    coordinates: Mapping[str, float] = field(default_factory=dict)
    phase: int = 0
    leads: tuple[str, ...] = ()

    @property
    def coupling(self) -> Coupling:
        """The coordinates of the coupling, in which a finer setting may be the cheaper one."""
        return tuple(sorted(pair for pair in self.coordinates.items() if pair[0].startswith(_COUPLING)))

    @property
    def inside(self) -> Coupling:
        """The other coordinates: how finely the units compute."""
        return tuple(sorted(pair for pair in self.coordinates.items() if not pair[0].startswith(_COUPLING)))

    def is_finer(self, other: "Candidate") -> bool:
        """Whether it is nowhere coarser than `other`, and somewhere finer."""
        if self.group != other.group or self.coordinates.keys() != other.coordinates.keys():
            return False
        pairs = [(value, other.coordinates[key]) for key, value in self.coordinates.items()]
        return all(own >= theirs for own, theirs in pairs) and any(own > theirs for own, theirs in pairs)


@dataclass(frozen=True)
class Outcome:
    """What a candidate costs, in seconds, and its largest error over the tolerance for it: at most 1 is good enough.

    Its cost is at least `floor_s`, whatever disturbed the machine when it was measured.
    """

    cost_s: float
    worst: float
    floor_s: float

    @property
    def meets(self) -> bool:
        """Whether all tolerances are kept."""
        return self.worst <= 1.0


class Search:
    """Ask for what to run `next`, `tell` how it went, until there is nothing left.

    Attributes
    ----------
    outcomes:
        How it went, by the candidate's place in `candidates`; None for one without results.
    pruned:
        Why a candidate is not run, by its place.
    """

    def __init__(self, candidates: Sequence[Candidate]) -> None:
        self.candidates = candidates
        self.outcomes: dict[int, Outcome | None] = {}
        self.pruned: dict[int, str] = {}
        self._open = set(range(len(candidates)))
        self._places = {candidate.name: place for place, candidate in enumerate(candidates)}
        # Coarser candidates of each, and how much each costs at least.
        self._coarser = _coarser(candidates)
        self._floor = dict.fromkeys(self._open, 0.0)
        self._rises: dict[tuple[Hashable, Coupling], list[Coupling]] = {}

    @property
    def best(self) -> int | None:
        """The cheapest so far that keeps all tolerances."""
        meeting = [place for place, outcome in self.outcomes.items() if outcome is not None and outcome.meets]
        return min(meeting, key=self._cost, default=None)

    def next(self, most: int = 1) -> list[int]:
        """Up to `most` candidates to be run now, those that may be cheapest first; none when the search is over."""
        self._prune()
        if not self._open:
            return []
        phase = min(self.candidates[place].phase for place in self._open)
        now = {place for place in self._open if self.candidates[place].phase == phase}
        ready = [place for place in now if now.isdisjoint(self._coarser[place])]
        return sorted(ready, key=lambda place: (self._floor[place], place))[:most]

    def tell(self, place: int, outcome: Outcome | None) -> None:
        """How it went with a candidate; None if it has no results."""
        self.outcomes[place] = outcome
        self._open.discard(place)

    def finalists(self, within: float, most: int) -> list[int]:
        """The candidates that keep all tolerances and may cost no more than the best does, cheapest first.

        `within` is the part of the best's cost by which the least that is known of theirs may exceed it; so many at
        most.
        """
        best = self.best
        if best is None:
            return []
        meeting = {place: outcome for place, outcome in self.outcomes.items() if outcome is not None and outcome.meets}
        limit = (1.0 + within) * meeting[best].cost_s
        near = [place for place, outcome in meeting.items() if outcome.floor_s <= limit]
        return sorted(near, key=self._cost)[:most]

    def reconsider(self) -> None:
        """Judge all that was pruned again: what is known of costs has changed."""
        self._open.update(self.pruned)
        self.pruned.clear()

    def nearest(self) -> int | None:
        """The candidate with the smallest worst error over tolerance, whether it meets them or not."""
        done = [place for place, outcome in self.outcomes.items() if outcome is not None and outcome.worst < inf]
        return min(done, key=self._worst, default=None)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _prune(self) -> None:
        best = self.best
        self._rises = self._risen()
        for place in sorted(self._open):
            reason = self._reason(place, best)
            if reason:
                self.pruned[place] = reason
                self._open.discard(place)

    def _reason(self, place: int, best: int | None) -> str:
        for lead in self.candidates[place].leads:
            reason = self._hopeless(self._places[lead])
            if reason:
                return reason
        for coarser in self._coarser[place]:
            outcome = self.outcomes.get(coarser)
            if outcome is None:
                continue
            self._floor[place] = max(self._floor[place], outcome.floor_s)
            if not self._costs_no_less(place, coarser):
                continue
            name = self.candidates[coarser].name
            if outcome.meets:
                return f"it is finer than a point that meets all tolerances, and so costs more: {name}"
            if best is not None and outcome.floor_s > (1.0 + NOISE) * self._cost(best):
                return (
                    f"it is finer than a point that costs {outcome.floor_s:.3g} s ({name}), while one that meets all "
                    f"tolerances costs {self._cost(best):.3g} s ({self.candidates[best].name})"
                )
        return ""

    def _costs_no_less(self, place: int, coarser: int) -> bool:
        """Whether a candidate is known to cost at least what one that is `coarser` does.

        It is where both couple alike. Else the cost has to rise already from the one coupling on its way to the other,
        for any two that differ in that alone: long communication steps may cost more than shorter ones, because the
        units are far from where they go.
        """
        own, other = self.candidates[place], self.candidates[coarser]
        if own.coupling == other.coupling:
            return True
        rises = self._rises.get((other.group, other.coupling), ())
        return any(_is_between(finer, other.coupling, own.coupling) for finer in rises)

    def _risen(self) -> dict[tuple[Hashable, Coupling], list[Coupling]]:
        """By group and coupling, the finer couplings at which something was seen to cost more, beyond noise."""
        alike: dict[Hashable, list[int]] = {}
        for place, outcome in self.outcomes.items():
            if outcome is not None:
                candidate = self.candidates[place]
                alike.setdefault((candidate.group, candidate.inside), []).append(place)
        found: dict[tuple[Hashable, Coupling], list[Coupling]] = {}
        for places in alike.values():
            for one, other in permutations(places, 2):
                coarse, fine = self.candidates[one], self.candidates[other]
                if fine.is_finer(coarse) and self._least(other) > (1.0 + NOISE) * self._least(one):
                    found.setdefault((coarse.group, coarse.coupling), []).append(fine.coupling)
        return found

    def _least(self, place: int) -> float:
        outcome = self.outcomes[place]
        return inf if outcome is None else outcome.floor_s

    def _hopeless(self, lead: int) -> str:
        """Why those that follow a lead cannot be good enough; empty if they may be."""
        name = self.candidates[lead].name
        if lead in self.outcomes:
            outcome = self.outcomes[lead]
            if outcome is not None and outcome.worst > _NEARLY:
                by = f"by a factor of {outcome.worst:.3g}" if outcome.worst < inf else "altogether"
                return f"it differs little from a point that misses the tolerances {by}: {name}"
        return ""

    def _cost(self, place: int) -> float:
        outcome = self.outcomes[place]
        return inf if outcome is None else outcome.cost_s

    def _worst(self, place: int) -> float:
        outcome = self.outcomes[place]
        return inf if outcome is None else outcome.worst


def _is_between(coupling: Coupling, coarser: Coupling, finer: Coupling) -> bool:
    """Whether a coupling is finer than the one, and nowhere finer than the other, which it may be itself."""
    triples = [(at, low, high) for (_, at), (_, low), (_, high) in zip(coupling, coarser, finer, strict=True)]
    return all(low <= at <= high for at, low, high in triples) and coupling != coarser


def _coarser(candidates: Sequence[Candidate]) -> dict[int, list[int]]:
    groups: dict[Hashable, list[int]] = {}
    for place, candidate in enumerate(candidates):
        groups.setdefault(candidate.group, []).append(place)
    return {
        place: [other for other in group if candidates[place].is_finer(candidates[other])]
        for group in groups.values()
        for place in group
    }
