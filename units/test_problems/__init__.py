"""Units that are not of a heart, whose coupling is known in closed form: schemes are tested on them."""

from .mass import Mass
from .response import Response

__all__ = ["Mass", "Response"]
