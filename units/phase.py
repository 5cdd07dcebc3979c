"""The phases of a unit's life cycle."""

from enum import Enum


class Phase(Enum):
    """The phases, in their order (FMI 2.0.4, section 4.2.4); the value is for a person."""

    INSTANTIATED = "instantiated"
    INITIALIZATION = "in initialization mode"
    STEPPING = "initialized"
    TERMINATED = "terminated"

    @property
    def initialized(self) -> bool:
        """Whether there is a state, and what `Unit.prepare` makes."""
        return self in (Phase.STEPPING, Phase.TERMINATED)
