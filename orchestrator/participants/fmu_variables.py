"""What an FMU of FMI 2.0 or 3.0 declares: its fields as ports, its parameters, from the model description."""

import re
import zipfile
from collections.abc import Iterable, Sequence
from ctypes import c_double
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2ValueReference
from lxml import etree

from ...fmus.model_description import INPUT_INTERPOLATION, TOOL
from ..errors import InputError, did_you_mean
from .participant import Parameters, Port

_INDEXED = re.compile(r"^(.*)\[(\d+(?:,\d+)*)\]$")
#: How FMI calls an initial value that the caller may give.
_STARTED = ("exact", "approx")
#: The variables that an FMU computes itself.
_COMPUTED = ("output", "local", "calculatedParameter")
#: The types of whole numbers, with what they can hold. An enumeration is one too.
_WHOLE = {"Integer": (-(2**31), 2**31), "Enumeration": (-(2**31), 2**31)}
_WHOLE |= {f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1)) for bits in (8, 16, 32, 64)}
_WHOLE |= {f"UInt{bits}": (0, 2**bits) for bits in (8, 16, 32, 64)}
#: The types of real numbers, and those of them that are exchanged.
_REAL = ("Real", "Float64", "Float32")
_EXCHANGED = ("Real", "Float64")


def _accepts(kind: str, value: Any) -> bool:
    """Whether `value` may be given for a parameter of an FMI type."""
    # To Python a truth value is a number; to a person it is not.
    if isinstance(value, bool):
        return kind == "Boolean"
    if kind in _WHOLE:
        least, above = _WHOLE[kind]
        return isinstance(value, int) and least <= value < above
    if kind in _REAL:
        return isinstance(value, (int, float))
    # What is left are binaries and clocks, which a scenario has no words for.
    return kind == "String" and isinstance(value, str) and "\0" not in value


class Field:
    """A port of an FMU with its value references and values, as the raw FMI calls want them.

    There is a reference for each of the `size` values in FMI 2.0, and one for all in FMI 3.0.
    """

    def __init__(self, port: Port, references: list[int]) -> None:
        self.port = port
        self.size = port.size
        # The type is the same in FMI 3.0.
        self.references = (fmi2ValueReference * len(references))(*references)
        self.buffer = (c_double * self.size)()
        self.values = np.ctypeslib.as_array(self.buffer).reshape(port.shape)


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
    """InputError for a start value that the FMU's variable cannot have, or that is none to be given.

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
    if not _accepts(variable.type, value):
        raise InputError(f"{what} of type {variable.type} cannot be {value!r}")


def declares_ramps(variables: Iterable[Any]) -> bool:
    """Whether the FMU can ramp its inputs by itself, as this project's do, and has the parameter that says so."""
    return any(variable.name == INPUT_INTERPOLATION and variable.type == "String" for variable in variables)


def ramps_itself(variables: Iterable[Any], parameters: Parameters) -> bool:
    """Whether that parameter says `linear`."""
    return any(
        variable.name == INPUT_INTERPOLATION and parameters.get(variable.name, variable.start) == "linear"
        for variable in variables
    )


def real_fields(path: Path, variables: Iterable[Any], parameters: Parameters) -> tuple[list[Field], list[Field]]:
    """The Real inputs and outputs of the FMU at `path` (FMI 3.0: Float64, arrays among them).

    Scalars `x[1]`, `x[2]`, … are taken together as one field. `variables` are those of FMPy's model description; a
    dimension given by a structural parameter has that one's start value. InputError if the indices of a field do not
    fill an array.
    """
    groups: dict[tuple[str, str], list[tuple[tuple[int, ...], Any]]] = {}
    values: dict[str, Any] = {}
    for variable in variables:
        values[variable.name] = parameters.get(variable.name, variable.start)
        if variable.causality in ("input", "output") and variable.type in _EXCHANGED:
            match = None if variable.shape else _INDEXED.match(variable.name)
            name = match[1] if match else variable.name
            index = tuple(map(int, match[2].split(","))) if match else ()
            groups.setdefault((variable.causality, name), []).append((index, variable))
    annotations = _annotations(path)
    fields: dict[str, list[Field]] = {"input": [], "output": []}
    for (causality, name), members in groups.items():
        members.sort(key=lambda member: member[0])
        shape = members[-1][0]
        indices = [index for index, _ in members]
        # Counted first: a wild index is not to make a list of its size.
        if len(indices) != prod(shape) or indices != list(product(*(range(1, count + 1) for count in shape))):
            raise InputError(f"the FMU's variables {name}[…] do not fill an array of shape {shape} with indices from 1")
        # An array of FMI 3.0 is one variable, without an index.
        shape = shape or members[0][1].shape
        extra = annotations.get(name, {})
        # Of a foreign FMU every number is worth a column; this project's say so themselves.
        unsaid = "nothing" if shape or extra else "value"
        port = Port(
            name,
            members[0][1].unit,
            shape,
            extra.get("location", None if shape else "global"),
            extra.get("fixed") == "true" or members[0][1].variability in ("constant", "fixed"),
            live="needs" not in extra or float(values[extra["needs"]]) != 0.0,
            record=extra.get("record", unsaid),
            needs=extra.get("needs"),
            of=extra.get("of"),
        )
        fields[causality].append(Field(port, [variable.valueReference for _, variable in members]))
    return fields["input"], fields["output"]


def is_memoryless(path: Path) -> bool:
    """Whether the FMU says that its outputs follow its inputs whatever was before; only this project's do."""
    own = _own_annotations(path)
    unit = None if own is None else own.find("Unit")
    return unit is not None and unit.get("memoryless") == "true"


def _annotations(path: Path) -> dict[str, dict[str, str]]:
    """What this project's FMUs say of their fields beyond FMI: attributes by name; empty for foreign FMUs."""
    own = _own_annotations(path)
    return {} if own is None else {field.get("name"): dict(field.attrib) for field in own.iter("Field")}


def _own_annotations(path: Path) -> Any:
    """This project's element of the FMU's annotations; None in foreign FMUs."""
    with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as text:
        # In FMI 2.0 the annotations come before the many variables; nothing after them is parsed.
        for _, element in etree.iterparse(text, tag=("Tool", "Annotation", "ScalarVariable")):
            if element.tag == "ScalarVariable":
                return None
            if TOOL in (element.get("name"), element.get("type")):
                return element
    return None
