"""The theories by name. A new one is a file in this folder and a line here."""

from .theory import Theory

_ALL: tuple[Theory, ...] = ()

THEORIES: dict[str, Theory] = {theory.name: theory for theory in _ALL}
