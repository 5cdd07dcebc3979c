"""Reference experiments that FMUs carry (FMI-LS-REF): read, run again, and compared with their results."""

from .outcome import Outcome, Verdict, Verification
from .verify import verify_fmu

__all__ = ["Outcome", "Verdict", "Verification", "verify_fmu"]
