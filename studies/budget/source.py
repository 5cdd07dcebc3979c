"""A source of numerical error: what makes a scenario finer in one respect and leaves everything else as it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..point import told

#: Values at keys of a scenario.
Settings = Mapping[str, Any]

#: A level is how often a source is made finer than in the scenario: 1 is finer, 2 is finer twice, -1 is coarser.
COARSER, BASE, FINER, FINEST = -1, 0, 1, 2
LEVELS = (COARSER, BASE, FINER, FINEST)

#: By what a tolerance is divided from one level to the next, and the highest order that errors can have in it.
TOLERANCE_RATIO, TOLERANCE_ORDER = 4.0, 1.5


@dataclass(frozen=True)
class Level:
    """The settings of the run at a level of a source.

    Where no settings refine one source alone, `settings` refine another too and `beside` refine just that other one: a
    value at this level is then the difference of the two runs on top of the scenario's own value.
    """

    settings: Settings
    beside: Settings | None = None

    @property
    def runs(self) -> Sequence[Settings]:
        """The settings of all runs that it needs."""
        return [self.settings] if self.beside is None else [self.settings, self.beside]

    def __str__(self) -> str:
        return " against ".join(told(settings) for settings in self.runs)


@dataclass(frozen=True)
class Source:
    """A source of error with its `levels`; of those only some may be possible.

    `refined` says what a level changes. The order of accuracy is meant in `quantity`, which is divided by `ratio` from
    one level to the next; no method has a higher one than `highest_order`. `remedy` says what to do where the error
    cannot be told.
    """

    name: str
    refined: str
    quantity: str
    levels: Mapping[int, Level]
    remedy: str
    ratio: float = 2.0
    highest_order: float = 3.0
