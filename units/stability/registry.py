"""The theories by name. A new one is a file in this folder and a line here."""

from .pinned_front import PinnedFront
from .theory import Theory

_ALL: tuple[Theory, ...] = (PinnedFront(),)

THEORIES: dict[str, Theory] = {theory.name: theory for theory in _ALL}
