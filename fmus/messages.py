"""The log messages of an FMU about an exception."""

import traceback

from ..units.errors import InvalidInput, StepFailure

#: Log category of an error in the arguments of a call, not in the physics.
INVALID_INPUT = "invalidInput"

#: Log category of every other error, and that of warnings.
ERROR_CATEGORY = "logStatusError"
WARNING_CATEGORY = "logStatusWarning"


def category(error: Exception) -> str:
    """The log category of `error`."""
    return INVALID_INPUT if isinstance(error, InvalidInput) else ERROR_CATEGORY


def message(error: Exception) -> str:
    """The words of an error that a unit foresees; of any other the reason and the traceback."""
    if isinstance(error, (InvalidInput, StepFailure)):
        return str(error)
    # The reason comes first: some hosts cut a message off (FMPy after 2047 characters).
    return "".join(traceback.format_exception_only(error)) + "".join(traceback.format_exception(error))
