"""What a study of accuracy needs to know of a parameter that it refines: no physics, and nothing of the units."""

from dataclasses import dataclass


@dataclass(frozen=True)
class AccuracyParameter:
    """A parameter of a unit that decides the unit's numerical error.

    Parameters
    ----------
    name:
        As a scenario has it under `parameters`.
    kind:
        `step`, the longest internal time step, and `tolerance`, of an internal solver: the error falls as they are
        divided. `mesh`, a count of nested refinements, each halving h: the error falls as it is raised.
    default:
        The value where a scenario gives none, in the parameter's unit of measure; whole for `mesh`.
    lower_limit:
        No value below it is accepted.
    limit_is_allowed:
        Whether `lower_limit` is accepted itself.
    """

    name: str
    kind: str
    default: float | int
    lower_limit: float
    limit_is_allowed: bool
