"""What can go wrong in a unit, as two exceptions: the input is wrong, or the physics failed."""

from collections.abc import Iterable

#: Names that a message lists, and characters of each.
_MOST, _LONGEST = 20, 60


class InvalidInput(ValueError):
    """The caller gave something a unit cannot work with: a mesh, a parameter, an array, a call out of order.

    The message says what was given, what is expected and what to do about it.
    """


class CallOrderError(InvalidInput):
    """A unit's call came in a phase that does not allow it (FMI 2.0.4, section 4.2.4)."""


class StepFailure(RuntimeError):
    """A unit could not complete its initialisation or a step; its state is what it was before the call."""


def listed(names: Iterable[str]) -> str:
    """Names in their order, for a message: not more of them than a person reads."""
    every = sorted(name if len(name) <= _LONGEST else f"{name[:_LONGEST]}..." for name in names)
    return ", ".join(every[:_MOST]) + (f" and {len(every) - _MOST} more" if len(every) > _MOST else "") or "none"
