"""A study: what a person asks for in a YAML file. Which settings of a scenario are tried, and against what."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from ..orchestrator.scenario.model import NAME, FilePath, Positive

#: Values at keys of a scenario (`coupling.step_ms`).
Settings = dict[str, Any]

#: More references than two say nothing more about how far they are to be trusted.
_MOST_REFERENCES = 2

#: Halvings of the distance between two cells of a map: twenty are a millionth of it.
_MOST_HALVINGS = 20

#: More communication steps in every run of a map are a slip of the pen.
_MOST_STEPS = 10_000_000


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Line(_Section):
    """Points that belong together: every combination of the values in `vary`, with `set` the same for all."""

    name: Annotated[str, Field(min_length=1)]
    set: Settings = Field(default_factory=dict)
    vary: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(default_factory=dict)

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


class Study(_Section):
    """A whole study.

    `set` is for every point and for the references; `reference` are one or two (`references`); without `measures` all
    that the scenario has are taken.

    For stability maps: the two keys that a line varies are the axes, x first. `steps` gives every run so many
    communication steps, whatever their size. Between sound cells and others the distance along y is halved `bisect`
    times. `theory` names what predicts the boundary; `growth` says how the growth of disturbances is measured; a run
    that errs by more than the `tolerances`, by measure, is inaccurate.
    """

    name: Annotated[str, Field(pattern=NAME)]
    scenario: FilePath
    set: Settings = Field(default_factory=dict)
    reference: Annotated[Any, AfterValidator(_references)] = None
    measures: Annotated[list[str] | None, Field(min_length=1)] = None
    lines: Annotated[list[Line], Field(min_length=1)]
    steps: Annotated[int | None, Field(ge=1, le=_MOST_STEPS)] = None
    bisect: Annotated[int, Field(ge=0, le=_MOST_HALVINGS)] = 0
    theory: str | None = None
    growth: Literal["alternating", "modes"] = "alternating"
    tolerances: dict[str, Positive] = Field(default_factory=dict)

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
