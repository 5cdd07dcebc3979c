"""A study: what a person asks for in a YAML file. Which settings of a scenario are tried, and against what."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from ..orchestrator.scenario.section import Section
from ..orchestrator.scenario.values import FilePath, Name, Positive

#: Values at keys of a scenario (`coupling.step_ms`).
Settings = dict[str, Any]

#: More references than two say nothing more about how far they are to be trusted.
_MOST_REFERENCES = 2

#: Halvings of the distance between two cells of a map: twenty are a millionth of it.
_MOST_HALVINGS = 20

#: More communication steps in every run of a map are a slip of the pen.
_MOST_STEPS = 10_000_000


class Line(Section):
    """Points that belong together: every combination of the values in `vary`, with `set` the same for all of them."""

    name: Annotated[str, Field(min_length=1)] = Field(
        description="The name of the line, as the legend has it. No two lines may have the same name."
    )
    set: Settings = Field(
        default_factory=dict,
        description="Values of keys of the scenario for all points of this line, in addition to those of the study: "
        "`coupling.scheme: jacobi`.",
    )
    vary: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(
        default_factory=dict,
        description="Keys of the scenario with the list of values that each takes: `coupling.step_ms: [1, 2, 5]`. With "
        "several keys every combination of their values is a point. A stability map needs exactly two keys: that of "
        "the x axis first, then that of the y axis.",
    )

    @model_validator(mode="after")
    def _either(self) -> "Line":
        for key in self.vary:
            if key in self.set:
                raise ValueError(f"'{key}' is in `set` and in `vary`; remove it from one of them")
        return self


def _references(value: Any) -> list[Settings]:
    references = value if isinstance(value, list) else [value]
    if not 1 <= len(references) <= _MOST_REFERENCES or not all(isinstance(each, Mapping) for each in references):
        raise ValueError(
            "expected the settings of a finer run, {coupling.step_ms: 0.1}, or a folder, {results: DIR}, or a list of "
            "two of these, whose difference is then the uncertainty of the reference"
        )
    for each in references:
        if "results" in each and (len(each) > 1 or not isinstance(each["results"], str)):
            raise ValueError("`results` is the path of a results folder and cannot be combined with settings")
        if not each:
            raise ValueError("a reference needs settings that are finer than those of the lines")
    return references


class Study(Section):
    """A study: many runs of one scenario with different settings, compared in a chart, or in a map of stability.

    A chart (`cosim chart`) needs a `reference`. A stability map (`cosim stability`) needs lines of two keys each.
    """

    name: Name = Field(
        description="The name of the study. Its results go to `results/<name>` unless told otherwise. It begins with a "
        "letter or a digit; letters, digits, `_`, `-` and `.` may follow."
    )
    scenario: FilePath = Field(description="The path of the scenario file, relative to the study file.")
    set: Settings = Field(
        default_factory=dict,
        description="Values of keys of the scenario for all runs of the study, the references included: "
        "`run.participants: native`.",
    )
    reference: Annotated[Any, AfterValidator(_references)] = Field(
        default=None,
        description="What the errors of all points are taken from: the settings of a finer run, or the folder of one "
        "that is there, or a list of two of these, whose difference is the uncertainty of the reference.",
    )
    measures: Annotated[list[str] | None, Field(min_length=1)] = Field(
        default=None,
        description="The quantities whose errors are compared, such as `lv_volume_ml` or `activation_ms`. By default "
        "all that the scenario has.",
    )
    lines: Annotated[list[Line], Field(min_length=1)] = Field(
        description="The lines of the chart, or the panels of the map, each with its points."
    )
    steps: Annotated[int | None, Field(ge=1, le=_MOST_STEPS)] = Field(
        default=None,
        description="The number of communication steps of every run, whatever their size; `run.stop_ms` and "
        "`output.every_ms` follow from it and must not be given. By default every run lasts as long as the scenario.",
    )
    bisect: Annotated[int, Field(ge=0, le=_MOST_HALVINGS)] = Field(
        default=0,
        description="For stability maps: how many times the distance along y between a sound point and one that fails "
        "is halved by further runs, to find the boundary between them.",
    )
    theory: str | None = Field(
        default=None, description="For stability maps: the name of the theory that predicts the boundary of stability."
    )
    growth: Literal["alternating", "modes"] = Field(
        default="alternating",
        description="For stability maps: how the growth of disturbances is measured, by the alternation of exchanged "
        "fields (`alternating`), or by the modes of a linear system that are fitted to what is exchanged (`modes`).",
    )
    tolerances: dict[str, Positive] = Field(
        default_factory=dict,
        description="For stability maps: the largest error of a measure, in its unit of measure, with which a run "
        "counts as accurate; a `reference` is needed then.",
    )

    @model_validator(mode="after")
    def _named_once(self) -> "Study":
        names = [line.name for line in self.lines]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two lines have the name '{name}'; rename one of them")
        return self

    @model_validator(mode="after")
    def _compared(self) -> "Study":
        if self.tolerances and not self.reference:
            raise ValueError(
                "`tolerances` are of errors, which are taken from a `reference`; give one, {coupling.step_ms: 0.1}, or "
                "remove `tolerances`"
            )
        return self

    @property
    def references(self) -> list[Settings]:
        """The one reference, or the two; none where the study has none."""
        return list(self.reference or ())
