"""A scenario: what a person asks for in a YAML file, validated whole before anything runs."""

import sys
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from ..errors import did_you_mean
from ..quoting import quoted

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
# A kilometre in mm is far outside of any anatomy, and near enough to be computed with.
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Point = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]

#: How far a time may be from a whole number of steps and still be taken for rounding in the YAML file.
_WHOLE = 1e-9

#: Bytes of a name: the system allows 255, of which endings such as `.fmu` and `.partial` take some.
_LONGEST_NAME = 200

#: Bytes of a path, and of each of its parts.
_LONGEST_PATH, _LONGEST_PART = 4000, 255

#: More communication steps than any run can take are a slip of the pen.
_MOST_STEPS = 10_000_000

#: What a name has to look like; how that is said to a person stands in `problem`.
NAME = r"^\w[\w.-]*$"
UNIT_NAME = r"^[A-Za-z]\w*$"
PROBE_NAME = r"^\w+$"
WORKERS = r"^(threads|processes|(tcp|tls|ws|wss|ucx)://\S+)$"


def _scalar(value: Any) -> Any:
    if not isinstance(value, (bool, int, float, str)):
        raise ValueError("expected a number, a text, true or false")
    # Numbers beyond the range of floats, written out, are infinite too.
    if isinstance(value, (int, float)) and not abs(value) <= sys.float_info.max:
        raise ValueError("expected a finite number")
    return value


def _value(value: Any) -> Any:
    if not isinstance(value, list):
        return _scalar(value)
    if not value:
        raise ValueError("expected the values of an array, not an empty list")
    return [_scalar(each) for each in value]


def _name(name: str) -> str:
    if (size := len(name.encode())) > _LONGEST_NAME:
        raise ValueError(f"a name of {size} bytes; files are called after it, so more than {_LONGEST_NAME} are refused")
    return name


def _path(path: str) -> str:
    size = len(path.encode())
    if size > _LONGEST_PATH or any(len(part.encode()) > _LONGEST_PART for part in path.split("/")):
        raise ValueError(f"a path of {size} bytes, which no file has; correct it")
    return path


#: A number, a text or a truth value, or of an array the list of them, in row-major order.
Value = Annotated[Any, AfterValidator(_value)]
FilePath = Annotated[str, AfterValidator(_path)]

#: More of anything that is counted is a slip of the pen.
_MOST = 1_000_000_000


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def _groups(value: Any) -> list[str | int]:
    groups = value if isinstance(value, list) else [value]
    if not groups or not all(isinstance(group, str | int) and not isinstance(group, bool) for group in groups):
        raise ValueError("expected the name or the number of a group of triangles in the mesh file, or a list of such")
    if any(isinstance(group, int) and abs(group) >= 2**53 for group in groups):
        raise ValueError("expected numbers of groups as a mesh file has them, not one with so many digits")
    if any(isinstance(group, str) and len(group) > _LONGEST_GROUP for group in groups):
        raise ValueError(f"expected names of groups of at most {_LONGEST_GROUP} characters")
    return groups


def _scale(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if (
        value is not None
        and not (isinstance(value, str) and value in _LENGTHS_MM)
        and not (number and _SCALES[0] <= value <= _SCALES[1])
    ):
        raise ValueError(
            f"expected a unit of length, {', '.join(_LENGTHS_MM)}, or a number from {_SCALES[0]:g} to {_SCALES[1]:g} "
            "that makes mm of the file's coordinates"
        )
    return value


#: Nested refinements of a mesh: six make a quarter of a million tetrahedra of each.
_MOST_LEVELS = 6

#: Characters in the name of a group in a mesh file.
_LONGEST_GROUP = 200

#: The units of length that coordinates in a file may be in, in mm, and the factors that may stand in their place.
_LENGTHS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
_SCALES = (1e-6, 1e6)


class Scene(_Section):
    """The anatomy: a named geometry at a mesh size, or a mesh file; either is refined `refine` times.

    `boundaries` says which groups of the file, by name or number, make up a boundary; `scale` is the unit of length of
    its coordinates, or a factor.
    """

    geometry: str | None = None
    mesh: FilePath | None = None
    mesh_size_mm: Positive = 5.0
    refine: Annotated[int, Field(ge=0, le=_MOST_LEVELS)] = 0
    boundaries: dict[str, Annotated[Any, AfterValidator(_groups)]] = Field(default_factory=dict)
    scale: Annotated[Any, AfterValidator(_scale)] = None

    @model_validator(mode="after")
    def _one_of(self) -> "Scene":
        if (self.geometry is None) == (self.mesh is None):
            raise ValueError("give either `geometry` (with `mesh_size_mm`) or `mesh`, a mesh file")
        if self.mesh is not None and "mesh_size_mm" in self.model_fields_set:
            raise ValueError("`mesh_size_mm` has no meaning with `mesh`; remove it")
        if self.mesh is None and (self.boundaries or self.scale is not None):
            raise ValueError("`boundaries` and `scale` are for the content of a `mesh` file; remove them")
        return self

    @property
    def unit_mm(self) -> float:
        """What the coordinates in the mesh file are multiplied by."""
        return float(_LENGTHS_MM.get(self.scale or "mm", self.scale))


class UnitEntry(_Section):
    """One participant: a unit of this project by name, or any FMI 2.0 or 3.0 co-simulation FMU by path.

    `start` gives start values to variables of an FMU; a value for an array is that of all its elements, a list has one
    for each. `every` steps the unit at every so-many-th exchange only.
    """

    unit: str | None = None
    fmu: FilePath | None = None
    parameters: dict[str, Value] = Field(default_factory=dict)
    start: dict[str, Value] = Field(default_factory=dict)
    every: Annotated[int, Field(ge=1, le=_MOST)] = 1

    @model_validator(mode="after")
    def _one_of(self) -> "UnitEntry":
        if (self.unit is None) == (self.fmu is None):
            raise ValueError("give either `unit`, the name of a unit, or `fmu`, the path of an FMU")
        if self.start and self.fmu is None:
            raise ValueError("`start` is for the variables of an FMU; a unit starts from its `parameters`")
        return self


class ConnectionEntry(_Section):
    """A connection in its parts: for names that cannot be told from what is around them, and for programs.

    With `factor` or `offset` the input gets factor · value + offset, and units of measure are the writer's affair.
    """

    source: Annotated[str, Field(alias="from", min_length=1)]
    output: Annotated[str, Field(min_length=1)]
    target: Annotated[str, Field(alias="to", min_length=1)]
    input: Annotated[str, Field(min_length=1)]
    factor: Annotated[float | None, Field(allow_inf_nan=False)] = None
    offset: Annotated[float | None, Field(allow_inf_nan=False)] = None

    @property
    def law(self) -> tuple[float, float] | None:
        """Factor and offset; None where there are none."""
        if self.factor is None and self.offset is None:
            return None
        return (1.0 if self.factor is None else self.factor), self.offset or 0.0


#: How pydantic marks in which of its two forms a connection was read; no person has to see that.
AS_TEXT, AS_ENTRY = "[text]", "[entry]"


def _form(given: Any) -> str:
    """A mapping with none of the keys is a text that was broken at its colon."""
    is_entry = isinstance(given, ConnectionEntry) or (
        isinstance(given, Mapping) and not {"from", "output", "to", "input"}.isdisjoint(given)
    )
    return AS_ENTRY if is_entry else AS_TEXT


#: A connection as 'unit.output -> unit.input', or in its parts.
Written = Annotated[
    Annotated[str, Tag(AS_TEXT)] | Annotated[ConnectionEntry, Tag(AS_ENTRY)],
    Discriminator(_form),
]


class Inputs(_Section):
    """Signals that drive inputs: the columns of a CSV file."""

    file: Annotated[FilePath, Field(min_length=1)]


class CriterionEntry(_Section):
    """When a field counts as converged; of several measures any one is enough."""

    absolute: Positive | None = None
    relative: Positive | None = None
    residual_relative: Annotated[Positive | None, Field(alias="residual-relative")] = None

    @model_validator(mode="after")
    def _one(self) -> "CriterionEntry":
        if self.absolute is None and self.relative is None and self.residual_relative is None:
            raise ValueError("give a limit: `relative`, `absolute` or `residual-relative`")
        return self


class Iterate(_Section):
    """Sweeps to convergence."""

    max_iterations: Annotated[int, Field(ge=1, le=_MOST)] = 20
    acceleration: Literal["none", "relaxation", "aitken", "anderson"] = "none"
    relaxation: Annotated[float | None, Field(gt=0, le=2)] = None
    converge: Annotated[dict[str, CriterionEntry], Field(min_length=1)]
    on_limit: Literal["error", "warn"] = "error"

    def limits_times(self, factor: float) -> dict[str, dict[str, float]]:
        """The limits by field and measure, as `converge` has them, times a factor."""
        limits = {name: entry.model_dump(by_alias=True, exclude_none=True) for name, entry in self.converge.items()}
        return {name: {measure: limit * factor for measure, limit in own.items()} for name, own in limits.items()}


class Adaptive(_Section):
    """Communication steps by an error estimate; `tolerance` is relative to the fields' magnitudes."""

    tolerance: Positive = 0.1
    min_ms: Positive = 0.5
    max_ms: Annotated[Positive, Field(le=_MOST)] = 20.0

    @model_validator(mode="after")
    def _ordered(self) -> "Adaptive":
        if self.min_ms > self.max_ms:
            raise ValueError(f"`min_ms` ({self.min_ms:g}) is above `max_ms` ({self.max_ms:g}); change one of them")
        return self


class Coupling(_Section):
    """The scheme by which the units exchange their fields, and how inputs behave between exchanges.

    With `adaptive`, `step_ms` is the first step, and inputs are ramped and extrapolated to first order unless told
    otherwise: with held ones no step is long and accurate.
    """

    scheme: Literal["gauss-seidel", "jacobi"] = "gauss-seidel"
    order: list[str] | None = None
    step_ms: Positive = 1.0
    adaptive: Adaptive | None = None
    iterate: Iterate | None = None
    interpolation: Literal["hold", "linear"] = "hold"
    extrapolation: Literal[0, 1, 2] = 0

    @model_validator(mode="before")
    @classmethod
    def _second_order(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("adaptive") is not None:
            return {"interpolation": "linear", "extrapolation": 1} | given
        return given


class Run(_Section):
    """How long, by FMUs (`fmu3`: of FMI 3.0) or by direct calls, where the units work, and what guards a long run.

    `workers` names where units step at the same time: `threads`, `processes`, or the address of a Dask scheduler.
    `checkpoint_every` counts accepted steps; 0 writes no checkpoints. `unit_time_limit_s` bounds a unit's step.
    """

    stop_ms: Positive = 320.0
    participants: Literal["fmu", "fmu3", "native"] = "fmu"
    workers: Annotated[str | None, Field(pattern=WORKERS)] = None
    unit_time_limit_s: Positive | None = None
    checkpoint_every: Annotated[int, Field(ge=0, le=_MOST)] = 50

    @model_validator(mode="after")
    def _limited(self) -> "Run":
        if self.unit_time_limit_s is not None and self.workers in (None, "threads"):
            raise ValueError("`unit_time_limit_s` needs units in processes of their own; add `workers: processes`")
        return self


class Output(_Section):
    """What is kept, and how often.

    `variables` are those that the time series has, `unit.variable`, where `*` and `?` stand for any characters; if none
    are given, it has what the units' outputs ask for.
    """

    every_ms: Positive = 5.0
    variables: Annotated[list[str] | None, Field(min_length=1)] = None
    probes_mm: dict[Annotated[str, Field(pattern=PROBE_NAME), AfterValidator(_name)], Point] = Field(
        default_factory=dict
    )


class Scenario(_Section):
    """A whole scenario.

    `connections` are those that are written; with `connect_by_name` every other input is fed by the output of its name.
    `inputs` drive what is not connected.
    """

    name: Annotated[str, Field(pattern=NAME), AfterValidator(_name)]
    scene: Scene | None = None
    units: Annotated[
        dict[Annotated[str, Field(pattern=UNIT_NAME), AfterValidator(_name)], UnitEntry], Field(min_length=1)
    ]
    connections: list[Written] = Field(default_factory=list)
    connect_by_name: bool = True
    inputs: Inputs | None = None
    coupling: Coupling = Coupling()
    run: Run = Run()
    output: Output = Output()

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
                    f"`run.stop_ms` ({self.run.stop_ms:g} ms) is no whole number of `output.every_ms` "
                    f"({self.output.every_ms:g} ms), which `coupling.adaptive` needs; change one of them"
                )
            return self
        step = self.coupling.step_ms
        for key, time in (("run.stop_ms", self.run.stop_ms), ("output.every_ms", self.output.every_ms)):
            self._check_count(key, time, time / step, "step_ms")
            if not is_whole(time / step):
                raise ValueError(
                    f"`{key}` ({time:g} ms) is no whole number of steps of `coupling.step_ms` "
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
