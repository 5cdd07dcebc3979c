"""What a run says of a machine on which something is not installed: tests hold the rest of it to the letter."""

from cardiac_cosim.units import kernels
from cardiac_cosim.units.mechanics.solvers.choice import LinearSolver

#: What runs on this machine are slow for, in the words of the units; nothing where all is installed.
FALLBACKS = (*kernels.fallback(), *LinearSolver().fallback())


def without_fallbacks(text: str) -> str:
    """What a run has said, without the warnings that every run on this machine gives."""
    for sentence in FALLBACKS:
        text = text.replace(f"warning: {sentence}\n", "")
    return text
