"""The record of a field that alternates from step to step."""

from dataclasses import dataclass

#: A field that alternates is growing, ringing on, or dying away; from the worst on.
GROWING, RINGING, DECAYING = KINDS = ("growing", "ringing", "decaying")


@dataclass(frozen=True)
class Alternation:
    """A stretch of steps in each of which a field alternated.

    `rate` is the factor by which the alternation changed from one step to the next, the largest median over a window
    (`growth`); it repeats itself every `period_steps` steps of the field. `share` is its amplitude at `to_ms`, relative
    to how far the field has moved in the whole run up to there.
    """

    kind: str
    rate: float
    period_steps: int
    from_ms: float
    to_ms: float
    share: float

    def worse_than(self, other: "Alternation | None") -> bool:
        """Whether this one is to be reported before `other`."""
        if other is None:
            return True
        ranks = KINDS.index(self.kind), KINDS.index(other.kind)
        return ranks[0] < ranks[1] or (ranks[0] == ranks[1] and self.rate > other.rate)
