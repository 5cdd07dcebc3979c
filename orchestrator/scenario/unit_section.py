"""The section `units` of a scenario: an entry for each participant of the co-simulation."""

from typing import Annotated

from pydantic import Field, model_validator

from .section import Section
from .values import MOST, FilePath, Value


class UnitEntry(Section):
    """One participant: a unit of this project, by its name, or any FMI 2.0 or 3.0 co-simulation FMU, by its path."""

    unit: str | None = Field(
        default=None, description="The name of a unit that comes with the project. Give either `unit` or `fmu`."
    )
    fmu: FilePath | None = Field(
        default=None,
        description="The path of a co-simulation FMU of FMI 2.0 or 3.0, relative to the scenario file, or of the "
        "folder that one was unpacked to. Give either `fmu` or `unit`.",
    )
    parameters: dict[str, Value] = Field(
        default_factory=dict,
        description="Values of the unit's parameters by their names; those that are not given have their defaults. "
        "`cosim show FILE --parameters` lists them all with their units of measure and limits.",
    )
    start: dict[str, Value] = Field(
        default_factory=dict,
        description="Start values of variables of an FMU by their names. A single value given for an array is that of "
        "all its elements; a list has one value for each element.",
    )
    every: Annotated[int, Field(ge=1, le=MOST)] = Field(
        default=1,
        description="The unit steps at every n-th communication point only, and at output times; its steps are longer "
        "then. By default it steps at all of them.",
    )

    @model_validator(mode="after")
    def _one_of(self) -> "UnitEntry":
        if (self.unit is None) == (self.fmu is None):
            raise ValueError("give either `unit`, the name of a unit, or `fmu`, the path of an FMU")
        if self.start and self.fmu is None:
            raise ValueError("`start` is for the variables of an FMU; a unit starts from its `parameters`")
        return self
