"""A scenario: what a person asks for in a YAML file, validated whole before anything runs."""

from typing import Annotated, Any

from pydantic import Field, model_validator

from ..errors import did_you_mean
from ..quoting import quoted
from .connection_section import Written
from .coupling_section import Coupling
from .output_section import Inputs, Output
from .run_section import Run
from .scene_section import Scene
from .section import Section
from .unit_section import UnitEntry
from .values import Name, UnitName

#: How far a time may be from a whole number of steps and still be taken for rounding in the YAML file.
_WHOLE = 1e-9

#: More communication steps than any run can take are a slip of the pen.
_MOST_STEPS = 10_000_000


class Scenario(Section):
    """A scenario: the anatomy, the physics units on it, how they are coupled, and what is written to files."""

    name: Name = Field(
        description="The name of the scenario. Results go to `results/<name>` unless told otherwise. It begins with a "
        "letter or a digit; letters, digits, `_`, `-` and `.` may follow."
    )
    scene: Scene | None = Field(
        default=None, description="The anatomy. A scenario that consists of FMUs only needs none."
    )
    units: Annotated[dict[UnitName, UnitEntry], Field(min_length=1)] = Field(
        description="The participants of the co-simulation by a name of your choice, which begins with a letter; "
        "letters, digits and `_` may follow."
    )
    connections: list[Written] = Field(
        default_factory=list,
        description="The connections between outputs and inputs, each written as `unit.output -> unit.input`, as "
        "`unit.output * 0.001 + 273 -> unit.input` where the value is to be converted, or as an entry with the keys "
        "`from`, `output`, `to` and `input`. Where names match one to one, nothing has to be written.",
    )
    connect_by_name: bool = Field(
        default=True,
        description="Whether an input that `connections` leaves out is fed by the output of the same name, if there is "
        "exactly one.",
    )
    inputs: Inputs | None = Field(default=None, description="Signals from a file, for inputs that no unit feeds.")
    coupling: Coupling = Field(
        default=Coupling(),
        description="How the units exchange their fields in time. By default: explicit Gauss–Seidel, 1 ms.",
    )
    run: Run = Field(default=Run(), description="How long the run lasts and how the units are called.")
    output: Output = Field(default=Output(), description="What the run writes, and how often.")

    @model_validator(mode="after")
    def _anatomy(self) -> "Scenario":
        own = [name for name, entry in self.units.items() if entry.unit is not None]
        if self.scene is None and own:
            raise ValueError(f"the key 'scene' is missing; unit '{own[0]}' needs a mesh")
        if self.scene is None and self.output.probes_mm:
            raise ValueError("`output.probes_mm` needs a `scene`, whose mesh the points lie in; remove it")
        return self

    @model_validator(mode="after")
    def _observed(self) -> "Scenario":
        for text in self.output.variables or ():
            unit, _, variable = text.partition(".")
            if unit not in self.units:
                raise ValueError(
                    f"`output.variables`: {quoted(text)} is of no unit{did_you_mean(unit, self.units)}; "
                    "write unit.variable, or unit.* for all"
                )
            if not variable:
                raise ValueError(f"`output.variables`: {quoted(text)} names no variable; write {unit}.* for all")
        return self

    @model_validator(mode="after")
    def _whole_steps(self) -> "Scenario":
        adaptive = self.coupling.adaptive
        if adaptive is not None:
            steps = self.run.stop_ms / self.output.every_ms
            self._check_count("run.stop_ms", self.run.stop_ms, self.run.stop_ms / adaptive.min_ms, "adaptive.min_ms")
            if not is_whole(steps):
                raise ValueError(
                    f"`run.stop_ms` ({self.run.stop_ms:g} ms) is not a whole number of `output.every_ms` "
                    f"({self.output.every_ms:g} ms), which `coupling.adaptive` needs; change one of them"
                )
            return self
        step = self.coupling.step_ms
        for key, time in (("run.stop_ms", self.run.stop_ms), ("output.every_ms", self.output.every_ms)):
            self._check_count(key, time, time / step, "step_ms")
            if not is_whole(time / step):
                raise ValueError(
                    f"`{key}` ({time:g} ms) is not a whole number of steps of `coupling.step_ms` "
                    f"({step:g} ms); change one of them"
                )
        return self

    @staticmethod
    def _check_count(key: str, time: float, steps: float, step: str) -> None:
        if steps > _MOST_STEPS:
            raise ValueError(
                f"`{key}` ({time:g} ms) is {steps:.3g} steps of `coupling.{step}` ({time / steps:g} ms), "
                f"more than {_MOST_STEPS:.0e} are refused; change one of them"
            )

    def observed(self, unit: str) -> tuple[str, ...]:
        """What of a unit the time series is to have, as `output.variables` has it; empty where nothing is said."""
        pairs = (text.partition(".") for text in self.output.variables or ())
        return tuple(variable for name, _, variable in pairs if name == unit)

    def files(self) -> list[str]:
        """The files that the scenario names, beside its own, as it names them."""
        named = [None if self.scene is None else self.scene.mesh, *(entry.fmu for entry in self.units.values())]
        named.append(None if self.inputs is None else self.inputs.file)
        return list(dict.fromkeys(name for name in named if name is not None))

    def resolved(self) -> dict[str, Any]:
        """The scenario with every default written out; it can be loaded again."""
        without: dict[str, set[str]] = {}
        if self.scene is not None:
            without["scene"] = {"mesh_size_mm"} if self.scene.mesh is not None else {"boundaries", "scale"}
        content = self.model_dump(exclude=without or None, by_alias=True)
        if self.scene is None:
            del content["scene"]
        if self.inputs is None:
            del content["inputs"]
        if self.output.variables is None:
            del content["output"]["variables"]
        return content


def is_whole(steps: float) -> bool:
    """Whether a time over a step is a whole number of steps, one at least, but for rounding."""
    return round(steps) >= 1 and abs(steps - round(steps)) <= _WHOLE * steps
