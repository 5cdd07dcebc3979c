"""What a run says of a machine that is slow or lacks something: tests hold the rest of it to the letter."""

import re

from cardiac_cosim.units import kernels
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver

#: What runs on this machine are slow for, in the words of the units; nothing where all is installed.
FALLBACKS = (*kernels.fallback(), *LinearSolver().fallback())

#: A line on how far a run is, which those have in a pipe that take longer than two seconds.
_PROGRESS = re.compile(r"^[^\n:]+: \d+ % \([^\n]*\), elapsed [^\n]*\n", re.MULTILINE)


def without_fallbacks(text: str) -> str:
    """What a run has said, without the warnings that every run on this machine gives, and without its progress."""
    for sentence in FALLBACKS:
        text = text.replace(f"warning: {sentence}\n", "")
    return _PROGRESS.sub("", text)
