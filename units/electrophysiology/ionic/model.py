"""What the monodomain equation needs to know of an ionic model."""

from collections.abc import Callable
from typing import ClassVar, Protocol

from ...arrays import FloatArray

#: Rates of φ and of the states, from φ and the states.
Rates = Callable[..., tuple[FloatArray, ...]]


class IonicModel(Protocol):
    """A cell's membrane: the dimensionless potential φ, 0 at rest and about 1 when excited, and states of its own.

    A model is a frozen dataclass of its parameters (`variable.parameter`), and all models' parameters are parameters of
    the unit, so that their names differ. The unit scales φ to mV and keeps the states under the names given here.
    """

    #: Its name, as the parameter `ionic_model` has it.
    name: ClassVar[str]
    #: Names of its states beside φ.
    states: ClassVar[tuple[str, ...]]
    #: Whether its time is dimensionless, in units of the time scale β_t; else it is in ms, and β_t over its value
    #: `time_scale_ms` stretches it.
    dimensionless_time: ClassVar[bool]
    #: Name of its compiled twin, a function in units/kernels; None if it has none.
    kernel: ClassVar[str | None]

    def initial(self, phi: FloatArray) -> tuple[FloatArray, ...]:
        """The states of cells at rest of which some are given another potential `phi`, each of the shape of `phi`."""

    def __hash__(self) -> int:
        """That of its parameters, as a frozen dataclass has it."""

    @property
    def rates(self) -> Rates:
        """The rates of φ and of the states in the model's own time, without diffusion and stretch current."""

    @property
    def constants(self) -> tuple[float, ...]:
        """The parameters, in the order in which the compiled twin takes them."""

    @property
    def longest_step(self) -> float:
        """Step in the model's time below which an explicit step of second order is stable and resolves all rates."""

    @property
    def lowest_phi(self) -> float:
        """The φ at and below which the model means nothing; minus infinity if there is none."""

    @property
    def lowest_phi_reason(self) -> str:
        """What is there, for a person."""
