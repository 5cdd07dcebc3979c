"""A scenario: what a person asks for in a YAML file, validated whole before anything runs."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    model_validator,
)

from .errors import InputError, did_you_mean
from .quoting import quoted, shortened
from .untrusted.yaml_text import LARGEST_TEXT, parse_yaml

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

#: Problems of one file that are told, and characters of those of the command line that are repeated with each.
_MOST_PROBLEMS, _LONGEST_ORIGIN = 20, 300

#: Sections in sections that `--set` can name.
_DEEPEST_KEY = 20

#: More communication steps than any run can take are a slip of the pen.
_MOST_STEPS = 10_000_000

#: What a name has to look like, and how to say that to a person.
_NAME = r"^\w[\w.-]*$"
_UNIT_NAME = r"^[A-Za-z]\w*$"
_PROBE_NAME = r"^\w+$"
_WORKERS = r"^(threads|processes|(tcp|tls|ws|wss|ucx)://\S+)$"
_ALLOWED = {
    _WORKERS: "choose threads, processes, or the address of a Dask scheduler, tcp://host:port",
    _NAME: "begin with a letter or digit, then letters, digits, '_', '-' and '.'",
    _UNIT_NAME: "begin with a letter, then letters, digits and '_'",
    _PROBE_NAME: "use letters, digits and '_'",
}


def _scalar(value: Any) -> Any:
    if not isinstance(value, (bool, int, float, str)):
        raise ValueError("expected a number, a text, true or false")
    # Numbers beyond the range of floats, written out, are infinite too.
    if isinstance(value, (int, float)) and not abs(value) <= sys.float_info.max:
        raise ValueError("expected a finite number")
    return value


def _name(name: str) -> str:
    if (size := len(name.encode())) > _LONGEST_NAME:
        raise ValueError(f"a name of {size} bytes; files are called after it, so more than {_LONGEST_NAME} are refused")
    return name


def _path(path: str) -> str:
    size = len(path.encode())
    if size > _LONGEST_PATH or any(len(part.encode()) > _LONGEST_PART for part in path.split("/")):
        raise ValueError(f"a path of {size} bytes, which no file has; correct it")
    return path


Scalar = Annotated[Any, AfterValidator(_scalar)]
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


#: Characters in the name of a group in a mesh file.
_LONGEST_GROUP = 200

#: The units of length that coordinates in a file may be in, in mm, and the factors that may stand in their place.
_LENGTHS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
_SCALES = (1e-6, 1e6)


class Scene(_Section):
    """The anatomy: a named geometry at a mesh size, or a mesh file.

    `boundaries` says which groups of the file, by name or number, make up a boundary; `scale` is the unit of length of
    its coordinates, or a factor.
    """

    geometry: str | None = None
    mesh: FilePath | None = None
    mesh_size_mm: Positive = 5.0
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

    `start` gives start values to variables of an FMU; `every` steps the unit at every so-many-th exchange only.
    """

    unit: str | None = None
    fmu: FilePath | None = None
    parameters: dict[str, Scalar] = Field(default_factory=dict)
    start: dict[str, Scalar] = Field(default_factory=dict)
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
_AS_TEXT, _AS_ENTRY = "[text]", "[entry]"


def _form(given: Any) -> str:
    """A mapping with none of the keys is a text that was broken at its colon."""
    is_entry = isinstance(given, ConnectionEntry) or (
        isinstance(given, Mapping) and not {"from", "output", "to", "input"}.isdisjoint(given)
    )
    return _AS_ENTRY if is_entry else _AS_TEXT


#: A connection as 'unit.output -> unit.input', or in its parts.
Written = Annotated[
    Annotated[str, Tag(_AS_TEXT)] | Annotated[ConnectionEntry, Tag(_AS_ENTRY)],
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
    workers: Annotated[str | None, Field(pattern=_WORKERS)] = None
    unit_time_limit_s: Positive | None = None
    checkpoint_every: Annotated[int, Field(ge=0, le=_MOST)] = 20

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
    probes_mm: dict[Annotated[str, Field(pattern=_PROBE_NAME), AfterValidator(_name)], Point] = Field(
        default_factory=dict
    )


class Scenario(_Section):
    """A whole scenario.

    `connections` are those that are written; with `connect_by_name` every other input is fed by the output of its name.
    `inputs` drive what is not connected.
    """

    name: Annotated[str, Field(pattern=_NAME), AfterValidator(_name)]
    scene: Scene | None = None
    units: Annotated[
        dict[Annotated[str, Field(pattern=_UNIT_NAME), AfterValidator(_name)], UnitEntry], Field(min_length=1)
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
            if not _is_whole(steps):
                raise ValueError(
                    f"`run.stop_ms` ({self.run.stop_ms:g} ms) is no whole number of `output.every_ms` "
                    f"({self.output.every_ms:g} ms), which `coupling.adaptive` needs; change one of them"
                )
            return self
        step = self.coupling.step_ms
        for key, time in (("run.stop_ms", self.run.stop_ms), ("output.every_ms", self.output.every_ms)):
            self._check_count(key, time, time / step, "step_ms")
            if not _is_whole(time / step):
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


def _is_whole(steps: float) -> bool:
    return round(steps) >= 1 and abs(steps - round(steps)) <= _WHOLE * steps


def load_scenario(path: Path, assignments: Sequence[str] = ()) -> Scenario:
    """Read `path` and apply `assignments` (each `key.path=value`); InputError names the key and the remedy."""
    content = _read(path)
    if content is None:
        raise InputError(f"{path}: the file is empty; a scenario needs at least `name`, `scene` and `units`")
    if not isinstance(content, dict):
        raise InputError(f"{path}: a scenario is lines `key: value` with the keys {', '.join(Scenario.model_fields)}")
    return checked(content, path, assignments)


def checked(content: dict[str, Any], path: Path, assignments: Sequence[str] = ()) -> Scenario:
    """The scenario of a file's `content`, changed by `assignments`; InputError begins with the file's `path`."""
    for assignment in assignments:
        _assign(content, assignment)
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        problems = list(dict.fromkeys(_explain(problem) for problem in error.errors()))
        if len(problems) > _MOST_PROBLEMS:
            problems[_MOST_PROBLEMS:] = [f"and {len(problems) - _MOST_PROBLEMS} more problems"]
        origin = str(path)
        if assignments:
            origin += " with " + shortened(", ".join(f"--set {text}" for text in assignments), _LONGEST_ORIGIN)
        raise InputError(f"{origin}: " + f"\n{origin}: ".join(problems)) from None


def _read(path: Path) -> Any:
    try:
        with path.open("rb") as file:
            return parse_yaml(file.read(LARGEST_TEXT + 1))
    except FileNotFoundError:
        raise InputError(f"{path}: no such scenario file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: this is a folder; give the scenario's YAML file") from None
    except OSError as error:
        raise InputError(f"{path}: the scenario file cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _assign(content: dict[str, Any], assignment: str) -> None:
    key, separator, text = assignment.partition("=")
    *parents, last = [part.strip() for part in key.split(".")]
    told = shortened(assignment, _LONGEST_ORIGIN)
    if not separator or not all((*parents, last)) or len(parents) > _DEEPEST_KEY or not key.isprintable():
        raise InputError(f"--set {told}: write it as key.path=value, e.g. --set run.stop_ms=100")
    try:
        value = parse_yaml(text)
    except ValueError as error:
        raise InputError(f"--set {told}: the value is {error}") from None
    target = content
    for number, parent in enumerate(parents):
        section = target.get(parent)
        if not isinstance(section, dict | None):
            whole = shortened(".".join(parents[: number + 1]))
            raise InputError(
                f"--set {told}: '{shortened(parent)}' holds {_short(section)}, not a section; set it as a whole, "
                f"--set {whole}=..."
            )
        # A copy: in YAML two sections can be one and the same, by an alias.
        target[parent] = dict(section or {})
        target = target[parent]
    target[last] = value


def _explain(problem: Mapping[str, Any]) -> str:
    location = [shortened(str(part)) for part in problem["loc"] if part not in ("[key]", _AS_TEXT, _AS_ENTRY)]
    kind, given = problem["type"], problem["input"]
    key, is_key = ".".join(location), "[key]" in problem["loc"]
    context = problem.get("ctx", {})
    if kind == "extra_forbidden":
        return f"unknown key '{key}'{did_you_mean(location[-1], _keys_at(location[:-1]))}"
    if kind == "missing":
        return f"the key '{key}' is missing"
    if kind == "value_error":
        return f"'{key}': {context['error']}" if key else str(context["error"])
    if kind == "invalid_key" or (is_key and kind == "string_type"):
        return (
            f"'{key}': a key has to be text, not {_short(given)}; put it in quotes "
            "(or, if it is the rest of a number, write that with a point: 0.5)"
        )
    if kind == "string_pattern_mismatch":
        what = "choice" if context["pattern"] == _WORKERS else "name"
        return f"'{key}': {_short(given)} is no valid {what}; {_ALLOWED[context['pattern']]}"
    if kind == "literal_error":
        return f"'{key}' is {_short(given)}: it should be {context['expected']}{_nearest(given, context['expected'])}"
    return f"'{key}' is {_short(given)}: {_expected(kind, given, problem)}"


def _expected(kind: str, given: Any, problem: Mapping[str, Any]) -> str:
    """What should be there instead of `given`, and what to do about it."""
    if kind in ("model_type", "dict_type", "model_attributes_type", "too_short") and not given:
        return "the section has no content; fill it or remove the key"
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return "expected a section, lines `key: value` or {key: value, ...}"
    if problem["loc"][:2] == ("output", "probes_mm") and kind in ("list_type", "too_short", "too_long"):
        return "expected the three coordinates of a point in mm, [x, y, z]"
    if kind == "list_type":
        return "expected a list, lines `- item` or [item, item]"
    if kind == "string_type":
        return "expected a text" + ("" if given is None else "; put it in quotes")
    if kind in ("float_type", "int_type", "float_parsing"):
        unit = "; its unit of measure is the one the key's name ends in" if isinstance(given, str) else ""
        return f"expected a number, written alone and without quotes{unit}"
    if kind == "none_required":
        return "only null is possible yet; remove the key"
    message: str = problem["msg"]
    return message.replace("Input should be", "it should be")


def _nearest(given: Any, expected: str) -> str:
    names = [name.strip("' ") for name in expected.replace(" or ", ",").split(",")]
    hint = did_you_mean(str(given), names) if isinstance(given, str) else ""
    return hint if hint.startswith(";") and len(names) > 1 else ""


def _short(given: Any) -> str:
    return "empty" if given is None else quoted(given)


def _keys_at(location: Sequence[str]) -> list[str]:
    """The keys that the section at `location` may have."""
    sections: dict[str, type[BaseModel]] = {"scene": Scene, "coupling": Coupling, "run": Run, "output": Output}
    sections |= {"connections": ConnectionEntry, "inputs": Inputs}
    section = UnitEntry if location[:1] == ["units"] else sections.get(location[0], Scenario) if location else Scenario
    if location[:2] == ["coupling", "adaptive"]:
        section = Adaptive
    if location[:2] == ["coupling", "iterate"]:
        section = CriterionEntry if location[2:3] == ["converge"] else Iterate
    return [field.alias or name for name, field in section.model_fields.items()]
