"""A stability map: cells over two varied settings, each with the class of its run, and the boundaries between them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..trial import Trial

#: The classes of a run. `not run` is a cell whose two settings cannot stand together.
SOUND, INACCURATE, OSCILLATING = "sound", "inaccurate", "oscillating"
DIVERGED, NOT_CONVERGED, UNIT_FAILED = "diverged", "not converged", "unit failed"
NOT_RUN = "not run"

#: All classes, from the soundest on: the order of legends.
KINDS = (SOUND, INACCURATE, OSCILLATING, DIVERGED, NOT_CONVERGED, UNIT_FAILED, NOT_RUN)


@dataclass(frozen=True)
class Cell:
    """One run at the settings `x` and `y` of the two varied keys.

    `kind` is its class and `reason` says why in words. `measure` is by how much disturbances were seen to grow from one
    exchange to the next, `predicted` what theory says of that; 1 is the limit of both, None where nothing is known.
    `errors` are those against the reference, by measure. `bisected` cells lie between those of the study's grid.
    """

    x: Any
    y: Any
    kind: str
    reason: str = ""
    measure: float | None = None
    predicted: float | None = None
    errors: Mapping[str, float] = field(default_factory=dict)
    trial: Trial | None = None
    bisected: bool = False

    @property
    def is_sound(self) -> bool:
        """Whether its results can be used."""
        return self.kind == SOUND

    @property
    def is_stable(self) -> bool:
        """Whether it came to its end and nothing grew; how accurate it is, is another question."""
        return self.kind in (SOUND, INACCURATE)


@dataclass(frozen=True)
class Crossing:
    """Where, at `x`, cells turn from sound to something else: between the values `low` and `high` of `y`.

    `predicted` is where theory has the limit nearest to that; None where it has none.
    """

    x: Any
    low: float
    high: float
    predicted: float | None = None

    @property
    def measured(self) -> float:
        """The middle between the two."""
        return 0.5 * (self.low + self.high)


@dataclass(frozen=True)
class Panel:
    """One line of a study as a map: `xs` and `ys` are the values of its grid in the order of the study.

    `limit` are points (x, y) of the boundary that theory predicts, in pieces that hang together.
    """

    name: str
    x_key: str
    y_key: str
    xs: Sequence[Any]
    ys: Sequence[Any]
    cells: Sequence[Cell]
    crossings: Sequence[Crossing] = ()
    limit: Sequence[Sequence[tuple[float, float]]] = ()


@dataclass(frozen=True)
class StabilityMap:
    """A whole map.

    `formula` is the theory's condition of stability, empty without a theory. `tolerances` are the errors, by measure,
    beyond which a run is inaccurate; `references` say what errors are taken from. `notes` are sentences for a person.
    """

    name: str
    scenario: str
    panels: Sequence[Panel]
    theory: str
    formula: str
    tolerances: Mapping[str, float]
    references: Sequence[str]
    machine: Mapping[str, Any]
    versions: Mapping[str, str]
    notes: Sequence[str] = ()

    @property
    def cells(self) -> list[Cell]:
        """All cells."""
        return [cell for panel in self.panels for cell in panel.cells]
