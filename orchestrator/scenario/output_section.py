"""The sections `output` and `inputs` of a scenario: what is written to files, and what comes from them."""

from typing import Annotated

from pydantic import Field

from .section import Section
from .values import FilePath, Point, Positive, ProbeName


class Inputs(Section):
    """Signals from a file that drive inputs which no unit feeds."""

    file: Annotated[FilePath, Field(min_length=1)] = Field(
        description="The path of a CSV file, relative to the scenario file: first a column of times, `time_ms` "
        "(or `time`, in s), then one column for every input that it drives, called `unit.input`, or just `input` where "
        "one unit alone has it. Real numbers run linearly from row to row; all others keep their last value."
    )


class Output(Section):
    """What a run writes, and how often."""

    every_ms: Positive = Field(
        default=5.0,
        description="The time between two stored frames of all fields, in ms; a multiple of `coupling.step_ms`.",
    )
    variables: Annotated[list[str] | None, Field(min_length=1)] = Field(
        default=None,
        description="The variables whose values the time series has, written as `unit.variable`; `*` and `?` stand for "
        "any characters. By default each unit decides which of its outputs are recorded.",
    )
    probes_mm: dict[ProbeName, Point] = Field(
        default_factory=dict,
        description="Points at which the time series records fields such as the potential: a name, and the coordinates "
        "[x, y, z] in mm.",
    )
