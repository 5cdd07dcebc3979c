"""The section `coupling` of a scenario: how the units exchange their fields in time."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from .section import Section
from .values import MOST, Positive


class CriterionEntry(Section):
    """When a field counts as converged. If several limits are given, it is enough that one of them is met."""

    absolute: Positive | None = Field(
        default=None,
        description="The largest norm of the field's residual (its change from one sweep to the next), in the field's "
        "unit of measure.",
    )
    relative: Positive | None = Field(
        default=None, description="The largest norm of the field's residual, relative to the norm of the field itself."
    )
    residual_relative: Annotated[Positive | None, Field(alias="residual-relative")] = Field(
        default=None,
        description="The largest norm of the field's residual, relative to its residual at the first sweep of the same "
        "communication step.",
    )

    @model_validator(mode="after")
    def _one(self) -> "CriterionEntry":
        if self.absolute is None and self.relative is None and self.residual_relative is None:
            raise ValueError("give a limit: `relative`, `absolute` or `residual-relative`")
        return self


class Iterate(Section):
    """Implicit coupling: the units of a loop repeat a communication step until the exchanged fields have converged."""

    max_iterations: Annotated[int, Field(ge=1, le=MOST)] = Field(
        default=20, description="The largest number of sweeps over the units of a loop in one communication step."
    )
    acceleration: Literal["none", "relaxation", "aitken", "anderson"] = Field(
        default="none",
        description="How the next iterate is computed from the sweeps before: the values of the last sweep as they are "
        "(`none`), mixed with those before by a constant factor (`relaxation`) or by one that is adapted (`aitken`), "
        "or from several sweeps by least squares (`anderson`, also called IQN-ILS).",
    )
    relaxation: Annotated[float | None, Field(gt=0, le=2)] = Field(
        default=None,
        description="The relaxation factor; with `aitken` and `anderson` that of a step's first sweep. Default: 0.5, "
        "and 1 with `anderson`.",
    )
    converge: Annotated[dict[str, CriterionEntry], Field(min_length=1)] = Field(
        description="The criteria of convergence, by field: the name of an output that is exchanged in a loop, "
        "`stretch`, or with its unit, `mechanics.stretch`, where several units have an output of that name."
    )
    on_limit: Literal["error", "warn"] = Field(
        default="error",
        description="What happens if the criteria are not met within `max_iterations` sweeps: the run stops with an "
        "error (`error`), or it accepts the step and warns at the end (`warn`).",
    )

    def limits_times(self, factor: float) -> dict[str, dict[str, float]]:
        """The limits by field and measure, as `converge` has them, times a factor."""
        limits = {name: entry.model_dump(by_alias=True, exclude_none=True) for name, entry in self.converge.items()}
        return {name: {measure: limit * factor for measure, limit in own.items()} for name, own in limits.items()}


class Adaptive(Section):
    """Communication steps whose size is controlled by an estimate of the coupling error."""

    tolerance: Positive = Field(
        default=0.1,
        description="By how much inputs may be wrong over one step, as far as that can be estimated, relative to "
        "how far their fields have moved in the whole run. Steps that err more are repeated with a shorter size.",
    )
    min_ms: Positive = Field(
        default=0.5,
        description="The shortest communication step, in ms. It is accepted even if it misses the tolerance.",
    )
    max_ms: Annotated[Positive, Field(le=MOST)] = Field(
        default=20.0, description="The longest communication step, in ms."
    )

    @model_validator(mode="after")
    def _ordered(self) -> "Adaptive":
        if self.min_ms > self.max_ms:
            raise ValueError(f"`min_ms` ({self.min_ms:g}) is above `max_ms` ({self.max_ms:g}); change one of them")
        return self


class Coupling(Section):
    """How the units exchange their fields, and how an input behaves between two communication points."""

    scheme: Literal["gauss-seidel", "jacobi"] = Field(
        default="gauss-seidel",
        description="Which values a unit sees in a communication step. `gauss-seidel`: the units step one after the "
        "other, and a unit sees what those before it have just computed. `jacobi`: all units step independently, from "
        "the values at the last communication point.",
    )
    order: list[str] | None = Field(
        default=None,
        description="The execution order: the names of all units that step in time. By default it is the order in "
        "which `units` has them.",
    )
    step_ms: Positive = Field(
        default=1.0,
        description="The communication step size in ms. `run.stop_ms` and `output.every_ms` have to be whole multiples "
        "of it. With `adaptive` it is the size of the first step.",
    )
    adaptive: Adaptive | None = Field(
        default=None,
        description="Adaptive communication steps. With them `interpolation` is `linear` and `extrapolation` is 1 "
        "unless you say otherwise: with held inputs no step is both long and accurate. By default all steps have the "
        "size `step_ms`.",
    )
    iterate: Iterate | None = Field(
        default=None, description="Implicit coupling. By default the coupling is explicit: every unit steps once."
    )
    interpolation: Literal["hold", "linear"] = Field(
        default="hold",
        description="How a unit sees an input inside a communication step: constant (`hold`, a zero-order hold), or "
        "running linearly from the value at the step's begin to that at its end (`linear`, a first-order hold). With "
        "adaptive steps the default is `linear`.",
    )
    extrapolation: Literal[0, 1, 2] = Field(
        default=0,
        description="The polynomial order by which an input is extrapolated whose new value is not available yet; 0 "
        "takes the last known value. With adaptive steps the default is 1.",
    )

    @model_validator(mode="before")
    @classmethod
    def _second_order(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("adaptive") is not None:
            return {"interpolation": "linear", "extrapolation": 1} | given
        return given
