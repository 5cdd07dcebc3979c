"""The values that keys of a scenario may have: names, paths, numbers and points."""

import sys
from typing import Annotated, Any

from pydantic import AfterValidator, Field, WithJsonSchema

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
# A kilometre in mm is far outside of any anatomy, and near enough to be computed with.
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Point = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]

#: Bytes of a name: the system allows 255, of which endings such as `.fmu` and `.partial` take some.
_LONGEST_NAME = 200

#: Bytes of a path, and of each of its parts.
_LONGEST_PATH, _LONGEST_PART = 4000, 255

#: The types of a single value, in the words of JSON schema.
_SCALARS = ["number", "string", "boolean"]

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
Value = Annotated[
    Any,
    AfterValidator(_value),
    WithJsonSchema({"type": ["number", "string", "boolean", "array"], "items": {"type": _SCALARS}, "minItems": 1}),
]
FilePath = Annotated[str, AfterValidator(_path)]

#: The name of a scenario or a study, of a unit, and of a probe.
Name = Annotated[str, Field(pattern=NAME), AfterValidator(_name)]
UnitName = Annotated[str, Field(pattern=UNIT_NAME), AfterValidator(_name)]
ProbeName = Annotated[str, Field(pattern=PROBE_NAME), AfterValidator(_name)]

#: More of anything that is counted is a slip of the pen.
MOST = 1_000_000_000
