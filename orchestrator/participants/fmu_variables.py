"""What an FMU of FMI 2.0 or 3.0 declares: its fields as ports, its parameters, from the model description."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from ctypes import (
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
)
from dataclasses import replace
from itertools import product
from math import prod
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from fmpy.fmi2 import fmi2ValueReference

from ..errors import InputError, ParticipantError, did_you_mean
from ..quoting import quoted, shortened
from .fmu_description import MOST_DIMENSIONS, Described, Variable
from .participant import INDEXED, Parameters, Port, Ports, Values

#: How FMI calls an initial value that the caller may give.
_STARTED = ("exact", "approx")
#: The variables that an FMU computes itself.
_COMPUTED = ("output", "local", "calculatedParameter")
#: The types of whole numbers, with what they can hold. An enumeration is one too.
WHOLE = {"Integer": (-(2**31), 2**31), "Enumeration": (-(2**31), 2**31)}
WHOLE |= {f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1)) for bits in (8, 16, 32, 64)}
WHOLE |= {f"UInt{bits}": (0, 2**bits) for bits in (8, 16, 32, 64)}
_REAL = ("Real", "Float64", "Float32")
#: The types that are exchanged and recorded.
_TYPES = (*_REAL, *WHOLE, "Boolean", "String")
#: The causalities of what can be read.
READABLE = ("output", "input", "local", "parameter", "calculatedParameter", "structuralParameter", "independent")

#: Types as the functions of FMI 2 and 3 name them, where those have no functions of their own.
_KINDS = {2: {"Enumeration": "Integer"}, 3: {"Enumeration": "Int64"}}
#: What the functions take.
_CTYPES: dict[int, dict[str, Any]] = {
    2: {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p},
    3: {"Float64": c_double, "Float32": c_float, "Boolean": c_bool, "String": c_char_p}
    | {"Int8": c_int8, "Int16": c_int16, "Int32": c_int32, "Int64": c_int64}
    | {"UInt8": c_uint8, "UInt16": c_uint16, "UInt32": c_uint32, "UInt64": c_uint64},
}
#: What participants give of a type; of all others int64.
_GIVEN = {"Real": np.dtype(np.float64), "Float32": np.dtype(np.float64), "UInt64": np.dtype(np.uint64)}


def _accepts(kind: str, value: Any) -> bool:
    """Whether `value` may be given for a parameter of an FMI type."""
    # To Python a truth value is a number; to a person it is not.
    if isinstance(value, bool):
        return kind == "Boolean"
    if kind in WHOLE:
        least, above = WHOLE[kind]
        return isinstance(value, int) and least <= value < above
    if kind in _REAL:
        return isinstance(value, (int, float))
    # What is left are binaries and clocks, which a scenario has no words for.
    return kind == "String" and isinstance(value, str) and "\0" not in value


class Field:
    """A port of an FMU with its value references and values, as the raw FMI calls want them.

    There is a reference for each of the `size` values in FMI 2.0, and one for all in FMI 3.0. `kind` is the type in the
    names of FMI's functions, `fmi2GetReal`, `fmi3GetInt64`.
    """

    def __init__(
        self, port: Port, fmi_type: str, references: Sequence[int], fmi: int, interpolated: bool = False
    ) -> None:
        self.port = port
        #: Whether it is an input that may change inside a step.
        self.interpolated = interpolated
        self.size = port.size
        self._type, self._fmi = fmi_type, fmi
        self.kind = _KINDS[fmi].get(fmi_type, fmi_type)
        # The type is the same in FMI 3.0.
        self.references = (fmi2ValueReference * len(references)).from_buffer(np.array(references, np.uint32))
        self.buffer = (_CTYPES[fmi][self.kind] * self.size)()
        self._texts = self.kind == "String"
        self._numbers = None if self._texts else np.ctypeslib.as_array(self.buffer).reshape(port.shape)
        self._given = _GIVEN.get(port.type, np.dtype(np.int64))

    def element(self, name: str, place: int) -> "Field":
        """The field of one element by its name, in FMI 2.0."""
        port = replace(self.port, name=name, shape=())
        return Field(port, self._type, [self.references[place]], self._fmi, self.interpolated)

    @property
    def is_array_variable(self) -> bool:
        """Whether it is one variable of FMI 3.0, whose elements cannot be set by themselves."""
        return len(self.references) < self.size

    def values(self) -> Values:
        """What is in the buffer."""
        if self._numbers is None:
            texts = [(text or b"").decode("utf-8", errors="replace") for text in self.buffer]
            return np.array(texts, dtype=np.str_).reshape(self.port.shape)
        if self.port.type == "Boolean":
            return self._numbers != 0
        return self._numbers.astype(self._given)

    def fill(self, values: Values) -> None:
        """Put `values`, of the port's shape, into the buffer; ParticipantError for what the type cannot hold."""
        if self._numbers is None:
            self.buffer[:] = [str(text).encode() for text in np.asarray(values).ravel()]
            return
        if self._numbers.dtype == np.float64 or self.port.type == "Boolean":
            self._numbers[...] = values
            return
        self._check(np.asarray(values))
        self._numbers[...] = values

    def _check(self, values: Values) -> None:
        kind = self._numbers.dtype if self._numbers is not None else None
        if kind is None or not values.size:
            return
        if kind.kind == "f":
            wrong = np.abs(values) > np.finfo(kind).max
        else:
            limits = np.iinfo(kind)
            wrong = (values < limits.min) | (values > limits.max)
        if self.port.items:
            wrong = wrong | ~np.isin(values, self.port.items)
        if wrong.any():
            raise ParticipantError(
                f"'{self.port.name}' of type {self.port.type} cannot be {np.asarray(values)[wrong].flat[0]}"
            )


def check_parameters(parameters: Parameters, variables: Sequence[Any]) -> None:
    """InputError for a parameter that the FMU does not have, or that cannot have the value given."""
    declared = {
        variable.name: variable
        for variable in variables
        if variable.causality == "parameter" and variable.variability != "constant"
    }
    structural = {variable.name for variable in variables if variable.causality == "structuralParameter"}
    for name, value in parameters.items():
        if name in structural:
            raise InputError(f"'{name}' is a structural parameter, which keeps its start value here; remove it")
        if name not in declared:
            raise InputError(f"the FMU has no parameter '{name}'{did_you_mean(name, declared)}")
        _check_type(f"parameter '{name}'", declared[name], value)


def check_start(start: Parameters, variables: Iterable[Any]) -> None:
    """InputError for a start value that the FMU's variable cannot have, or of a variable that takes none.

    Start values are those of inputs, and of outputs and locals whose initial value is exact or approximate.
    """
    declared = {
        variable.name: variable
        for variable in variables
        if variable.causality == "input" or (variable.causality in _COMPUTED and variable.initial in _STARTED)
    }
    for name, value in start.items():
        if name not in declared:
            raise InputError(f"the FMU has no variable '{name}' that takes a start value{did_you_mean(name, declared)}")
        _check_type(f"start value of '{name}'", declared[name], value)


def _check_type(what: str, variable: Any, value: Any) -> None:
    values = value if isinstance(value, list) else [value]
    if isinstance(value, list) and (not variable.shape or len(value) != prod(variable.shape)):
        raise InputError(
            f"{what} has {len(value)} values, but the variable has "
            + (f"{prod(variable.shape)}, of the shape {variable.shape}" if variable.shape else "one")
        )
    for each in values:
        if not _accepts(variable.type, each):
            raise InputError(f"{what} of type {variable.type} cannot be {each!r}")


class Group(NamedTuple):
    """Variables that are one field: its name, first index and shape, the first of them, and all value references."""

    name: str
    base: int
    shape: tuple[int, ...]
    first: Variable
    references: Sequence[int]

    def elements(self) -> Iterator[str]:
        """The names of the variables that are elements of an array; none where it is a variable by itself."""
        if self.shape and not self.first.shape:
            for index in product(*(range(self.base, self.base + count) for count in self.shape)):
                yield f"{self.name}[{','.join(map(str, index))}]"


def groups(variables: Iterable[Variable], causalities: Collection[str]) -> list[Group]:
    """What the variables of some `causalities` are as scalars and arrays.

    Scalars `x[1]`, `x[2]`, … that fill an array, of indices from 1 or from 0, and are of one type and unit are taken
    together as one field; all others are fields of their own, under their full names. Binaries and clocks are left out.
    """
    chosen = [item for item in variables if item.causality in causalities and item.type in _TYPES]
    return [
        Group(name, base, shape, members[0], [member.valueReference for member in members])
        for name, base, shape, members in _grouped(chosen)
    ]


def fields(description: Described, found: Iterable[Group], parameters: Parameters) -> dict[str, Field]:
    """The fields of the groups `found` in a description, by name.

    A dimension given by a structural parameter has that one's start value. A field without values is left out.
    """
    made = {}
    for name, base, shape, first, references in found:
        port = _port(description, name, base, shape, first, parameters)
        if port.size:
            fmi = int(description.fmiVersion[0])
            # FMI 2.0 says it of all Real inputs of an FMU at once, FMI 3.0 besides of each.
            interpolated = port.is_real and (fmi == 2 or first.intermediateUpdate) and not port.discrete
            made[name] = Field(port, first.type, references, fmi, interpolated)
    return made


def ports(fields: Mapping[str, Field]) -> Ports:
    """The ports of `fields`."""
    return Ports({name: field.port for name, field in fields.items()})


_Members = tuple[str, int, tuple[int, ...], list[Variable]]


def _grouped(variables: Sequence[Variable]) -> Iterator[_Members]:
    """Name, first index, shape and members of what `variables` are as scalars and arrays."""
    by_name: dict[str, list[tuple[tuple[int, ...], Variable]]] = {}
    names = {variable.name for variable in variables}
    for variable in variables:
        name = variable.name
        index: tuple[int, ...] = ()
        if name[-1] == "]" and not variable.shape and (match := INDEXED.match(name)) is not None:
            name, index = match[1], tuple(map(int, match[2].split(",")))
        by_name.setdefault(name, []).append((index, variable))
    for name, members in by_name.items():
        if len(members) == 1 and not members[0][0]:
            # An array of FMI 3.0 is one variable, without an index.
            yield name, 1, members[0][1].shape, [members[0][1]]
            continue
        members.sort(key=itemgetter(0))
        shape = _filled([index for index, _ in members])
        alike = {(item.type, item.unit, item.variability, item.causality, len(item.shape)) for _, item in members}
        # Beside `x[1]` an array of `x[1][1]`, … has no name of its own.
        if shape is None or len(alike) > 1 or name in names:
            yield from ((item.name, 1, item.shape, [item]) for _, item in members)
        else:
            yield name, members[0][0][0], shape, [item for _, item in members]


def _filled(indices: Sequence[tuple[int, ...]]) -> tuple[int, ...] | None:
    """The shape of the array that sorted `indices` fill, each from 1 or each from 0; None if they fill none."""
    first, last = indices[0], indices[-1]
    count = len(first)
    if not 0 < count <= MOST_DIMENSIONS or count != len(last) or first not in ((0,) * count, (1,) * count):
        return None
    shape = tuple(end - first[0] + 1 for end in last)
    # Counted first: a wild index is not to make a list of its size.
    if len(indices) != prod(shape):
        return None
    return shape if list(indices) == list(product(*(range(first[0], end + 1) for end in last))) else None


def _port(
    description: Described, name: str, base: int, shape: tuple[int, ...], first: Variable, parameters: Parameters
) -> Port:
    extra = description.fields.get(name, {})
    needs = extra.get("needs")
    fixed = extra.get("fixed") == "true" or first.variability in ("constant", "fixed")
    is_real = first.type in _REAL
    return Port(
        name,
        first.unit,
        shape,
        extra.get("location", None if shape else "global"),
        fixed,
        live=needs is None or _value(description, needs, parameters) != 0.0,
        # Of a foreign FMU every number is worth a column; this project's say so themselves.
        record=extra.get("record", "nothing" if extra else "value"),
        needs=needs,
        of=extra.get("of"),
        type="Real" if first.type == "Float64" else first.type,
        discrete=not is_real or (first.variability == "discrete" and not fixed),
        items=tuple(first.items) if first.type == "Enumeration" else (),
        base=base,
        stand_in=extra.get("standIn") == "true",
    )


def _value(description: Described, parameter: str, parameters: Parameters) -> float:
    """The value of a Real parameter."""
    start = next((item.start for item in description.modelVariables if item.name == parameter), None)
    value = parameters.get(parameter, start or 0.0)
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"its parameter '{shortened(parameter)}' is {quoted(value)}; expected a number") from None
