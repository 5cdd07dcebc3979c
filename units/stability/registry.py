"""The theories by name. A new one is a file in this folder and a line here."""

from .loop_gain import LoopGain
from .theory import Theory

_ALL: tuple[Theory, ...] = (LoopGain(),)

THEORIES: dict[str, Theory] = {theory.name: theory for theory in _ALL}
