"""The parameter set of an experiment (SSP's SSV, 1.0 and 2.0): values for variables of the FMU, by their names."""

from collections.abc import Callable
from math import isfinite
from typing import Any

from ..errors import InputError, did_you_mean
from ..participants.fmu_description import Description, Variable
from ..participants.fmu_variables import WHOLE
from ..participants.participant import Parameters
from ..quoting import quoted, shortened
from ..untrusted.document import parse_document

#: What the namespaces of all versions begin with.
_NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"

_REAL = ("Real", "Float64", "Float32")


def read_parameter_set(
    content: bytes, description: Description, tell: Callable[[str], None]
) -> tuple[Parameters, Parameters]:
    """The values in a parameter set's `content`: of parameters, and start values of other variables.

    A name that no variable has is told to `tell`, for so the standard wants it. InputError for all that cannot be
    applied as it stands, with the name of the parameter.
    """
    root = parse_document(content)
    namespace, _, name = str(root.tag).rpartition("}")
    if name != "ParameterSet" or namespace != f"{{{_NAMESPACE}":
        raise InputError(f"its root is {shortened(str(root.tag))}, but a parameter set (SSV) has the root ParameterSet")
    if root.get("version") not in ("1.0", "2.0"):
        raise InputError(f"it is of version {quoted(root.get('version'))}; versions 1.0 and 2.0 are read")
    variables = {variable.name: variable for variable in description.modelVariables}
    parameters: dict[str, Any] = {}
    starts: dict[str, Any] = {}
    for element in root.iterfind("{*}Parameters/{*}Parameter"):
        name = element.get("name", "")
        if name not in variables:
            tell(f"the FMU has no variable '{shortened(name)}'; its value in the parameter set is not used")
            continue
        variable = variables[name]
        given = parameters if variable.causality == "parameter" else starts
        given[name] = _value(element, variable, f"the parameter '{shortened(name)}'")
    return parameters, starts


def _value(element: Any, variable: Variable, what: str) -> Any:
    value = next((child for child in element if child.get("value") is not None or child.get("name") is not None), None)
    if value is None:
        raise InputError(f"{what} has no value")
    if variable.shape or element.find("{*}Dimension") is not None:
        raise InputError(f"{what} is an array, which is not set by experiments here; leave it at its start value")
    unit = value.get("unit")
    if unit is not None and unit != (variable.unit or unit):
        raise InputError(
            f"{what} is given in {shortened(unit)}, and the FMU has it in {shortened(str(variable.unit))}; convert it"
        )
    text = value.get("value", value.get("name", ""))
    parsed = _parsed(text, variable)
    if parsed is None:
        raise InputError(f"{what} of type {variable.type} cannot be {quoted(text)}{_known(variable, text)}")
    return parsed


def _parsed(text: str, variable: Variable) -> Any:
    """The `text` as a value of the variable's type; None where it is none."""
    if variable.type == "String":
        return text
    if variable.type == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}.get(text.strip())
    if variable.type == "Enumeration":
        return {name: number for number, name in variable.items.items()}.get(text)
    try:
        if variable.type in WHOLE:
            return int(text)
        number = float(text)
    except ValueError:
        return None
    return number if variable.type in _REAL and isfinite(number) else None


def _known(variable: Variable, text: str) -> str:
    return did_you_mean(text, variable.items.values()) if variable.type == "Enumeration" else ""
