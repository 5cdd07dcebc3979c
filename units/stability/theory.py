"""A theory of stability: from a coupled system to the factor by which a disturbance grows from exchange to exchange."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, TypeVar

from ..arrays import FloatArray
from ..errors import InvalidInput
from ..mesh import Mesh
from ..variable import parameters_of

Group = TypeVar("Group")

#: Fields of one moment by name: `stretch`, `active_stress` in kPa, `displacement` in mm, `fiber`, `sheet`, `potential`.
Moment = Mapping[str, FloatArray]


@dataclass(frozen=True)
class Setting:
    """A unit as a scenario has it: its `kind` (`mechanics`), and all its parameters, defaults included."""

    kind: str
    parameters: Mapping[str, Any]

    def group(self, kind: type[Group]) -> Group:
        """The values of one group of parameters, as that frozen dataclass; defaults where an FMU has none of them."""
        names = [variable.name for variable in parameters_of(kind)]
        return kind(**{name: self.parameters[name] for name in names if name in self.parameters})


@dataclass(frozen=True)
class Coupled:
    """A coupled system as a theory sees it.

    Parameters
    ----------
    units:
        By their names in the scenario, in the order in which they step; those that never do come first.
    jacobi:
        Whether all units step at once, and not one after the other.
    step_ms:
        The communication step.
    linear:
        Whether units follow their inputs along a line inside a step.
    extrapolation:
        Polynomial order by which inputs are extrapolated that are not known yet.
    mesh:
        Gives the scene's mesh; None without a scene.
    moments:
        Gives the moments of a sound run of the same system, where there is one; an empty sequence otherwise.
    """

    units: Mapping[str, Setting]
    jacobi: bool
    step_ms: float
    linear: bool = False
    extrapolation: int = 0
    mesh: Callable[[], Mesh] | None = None
    moments: Callable[[], Sequence[Moment]] = field(default=tuple)

    def only(self, *kinds: str) -> Setting:
        """The one unit of one of these kinds; InvalidInput where there is none, or several."""
        found = [unit for unit in self.units.values() if unit.kind in kinds]
        if len(found) != 1:
            raise InvalidInput(f"the theory applies to a scenario with one unit {' or '.join(kinds)}, not {len(found)}")
        return found[0]


class Theory(Protocol):
    """What is predicted, and by which formula."""

    #: Its name, as a study gives it.
    name: ClassVar[str]
    #: The condition of stability, for a person: `|g| < 1, g = −K_a/K_p`.
    formula: ClassVar[str]
    #: Whether an evaluation takes long: it is asked at the values of a study only then.
    costly: ClassVar[bool] = False
    #: Whether it is of explicit exchange: it is not asked of coupling that is iterated or adaptive then. Others are of
    #: steps inside of units, or of their meshes, whatever the coupling.
    of_exchange: ClassVar[bool] = True

    def amplification(self, coupled: Coupled) -> float:
        """The factor by which a disturbance grows from one step to the next; 1 is the limit of stability.

        InvalidInput where the theory does not fit the system.
        """
