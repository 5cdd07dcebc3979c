"""What can go wrong in a unit, as two exceptions: the input is wrong, or the physics failed."""


class InvalidInput(ValueError):
    """The caller gave something a unit cannot work with: a mesh, a parameter, an array, a call out of order.

    The message says what was given, what is expected and what to do about it.
    """


class CallOrderError(InvalidInput):
    """A unit's call came in a phase that does not allow it (FMI 2.0.4, section 4.2.4)."""


class StepFailure(RuntimeError):
    """A unit could not complete its initialisation or a step; its state is what it was before the call."""
