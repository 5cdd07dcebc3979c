"""What a person needs to know of a unit's parameter to set it: told to those who know no physics."""

from dataclasses import dataclass


@dataclass(frozen=True)
class UnitParameter:
    """A parameter of a unit of this project.

    Parameters
    ----------
    name:
        As a scenario has it under `parameters`.
    default:
        The value where a scenario gives none: a number, a whole number, or one of the `choices`.
    measure:
        The unit of measure of numbers; "1" for a pure number.
    description:
        What it is, in a few words.
    above, at_least, below:
        Limits of a number, where there are such: the value is > `above`, ≥ `at_least`, < `below`.
    choices:
        The texts that are allowed, if it is a text.
    """

    name: str
    default: float | int | str
    measure: str
    description: str
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()

    @property
    def limits(self) -> str:
        """The values that are allowed, for a person: `> 0 and < 1`, `whole, >= 0`, or the choices."""
        if self.choices:
            return " | ".join(self.choices)
        bounds = ((">", self.above), (">=", self.at_least), ("<", self.below))
        told = " and ".join(f"{sign} {bound:g}" for sign, bound in bounds if bound is not None)
        return ", ".join(part for part in ("whole" if isinstance(self.default, int) else "", told) if part)
