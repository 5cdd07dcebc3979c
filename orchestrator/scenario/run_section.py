"""The section `run` of a scenario: how long, by which means, and what guards a long run."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from .section import Section
from .values import MOST, WORKERS, Positive


class Run(Section):
    """How long a run lasts, how the units are called, where they work, and what guards a long run."""

    stop_ms: Positive = Field(default=320.0, description="The end of the simulated time, in ms; the run begins at 0.")
    participants: Literal["fmu", "fmu3", "native"] = Field(
        default="fmu",
        description="How the units of this project are called: as FMUs of FMI 2.0 (`fmu`) or FMI 3.0 (`fmu3`), or "
        "directly, without FMI (`native`). All three give the same bits.",
    )
    workers: Annotated[str | None, Field(pattern=WORKERS)] = Field(
        default=None,
        description="Where units that can step at the same time do so: in `threads`, in `processes`, or by the workers "
        "of a Dask scheduler, whose address is given as tcp://host:port. By default they step one after the other.",
    )
    unit_time_limit_s: Positive | None = Field(
        default=None,
        description="The longest time in s that one step of a unit may take before the run stops with an error; it "
        "needs `workers: processes` or a Dask scheduler. By default there is no limit.",
    )
    checkpoint_every: Annotated[int, Field(ge=0, le=MOST)] = Field(
        default=50,
        description="After how many accepted communication steps a checkpoint is written, from which `--resume` "
        "continues; 0 writes none.",
    )

    @model_validator(mode="after")
    def _limited(self) -> "Run":
        if self.unit_time_limit_s is not None and self.workers in (None, "threads"):
            raise ValueError("`unit_time_limit_s` needs units in processes of their own; add `workers: processes`")
        return self
