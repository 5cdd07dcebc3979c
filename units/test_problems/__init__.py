"""Units without a heart in them whose coupling is known in closed form: what schemes are tried on."""

from .mass import Mass
from .response import Response

__all__ = ["Mass", "Response"]
