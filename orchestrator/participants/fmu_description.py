"""The model description of an FMU, read by FMPy but for the many variables of FMI 2.0.

A heart's four FMUs have 113 000 scalars. FMPy makes an object of two dozen attributes of each, which takes three
quarters of the time to set a run up; what the master needs of them is read here, and FMPy is given the rest. Scenarios
and system packages read all FMUs through here.
"""

import gc
import io
import zipfile
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import fmpy
from lxml import etree

from ...fmus.annotations import NAMESPACE, TOOL
from ..errors import InputError
from ..quoting import quoted, shortened
from .fmu_file import DESCRIPTION, FmuFile

_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")

#: The initial value's kind where a variable does not say it, by variability; outputs and locals, parameters and inputs
#: (FMI 2.0.4, section 2.2.7).
_EXACT = {("constant", "output"), ("constant", "local"), ("fixed", "parameter"), ("tunable", "parameter")}

_TRUE = ("true", "1")

#: Value references are 32 bits wide.
_REFERENCES = 2**32

#: Dimensions of an array; NumPy's own limit is 32 in its older versions.
MOST_DIMENSIONS = 16

#: Elements of an array, 160 MB of numbers; more is a slip of the pen, or meant to fill the memory.
_MOST_ELEMENTS = 20_000_000

_FIELD = f"{{{NAMESPACE}}}Field"
_NO_FIELDS: Mapping[str, Mapping[str, str]] = {}


class Variable(NamedTuple):
    """What the master needs of a variable; named as in FMPy. What it leaves to its declared type is filled in."""

    name: str
    valueReference: int
    type: str
    causality: str
    variability: str
    initial: str | None
    unit: str | None
    start: str | None
    #: There are no arrays in FMI 2.0.
    shape: tuple[int, ...] = ()
    relativeQuantity: bool = False
    #: FMPy's SimpleType.
    declaredType: Any = None
    #: Whether an input may be set inside a step (FMI 3.0, section 2.4.7.4).
    intermediateUpdate: bool = False

    @property
    def items(self) -> dict[int, str]:
        """The names of an enumeration's items by their numbers."""
        return {} if self.declaredType is None else {int(item.value): item.name for item in self.declaredType.items}


class CoSimulation(NamedTuple):
    """What the master needs of the element of that name; named as in FMPy, with FMI 3.0's names as those of FMI 2.0.

    An FMU of FMI 3.0 interpolates inputs by intermediate updates.
    """

    modelIdentifier: str
    canHandleVariableCommunicationStepSize: bool
    canInterpolateInputs: bool
    canBeInstantiatedOnlyOncePerProcess: bool
    canGetAndSetFMUstate: bool
    canSerializeFMUstate: bool


@dataclass(frozen=True)
class Described:
    """What a participant needs of a model description; what FMPy has of it is named as there.

    `fields` and `memoryless` are what this project's FMUs say beyond FMI: attributes of inputs and outputs by name, and
    whether outputs follow the inputs whatever was before.
    """

    fmiVersion: str
    guid: str
    generationTool: str
    coSimulation: CoSimulation
    modelVariables: Sequence[Variable]
    fields: Mapping[str, Mapping[str, str]]
    memoryless: bool


@dataclass(frozen=True)
class Description(Described):
    """A model description, with what a system package asks of it."""

    unitDefinitions: Sequence[Any]
    defaultExperiment: Any


def read_description(file: FmuFile) -> Description:
    """The description of an FMU that can be coupled; InputError says why it cannot be, or what is wrong with it."""
    with _no_collection():
        root = file.description()
        version = _version(root)
        try:
            head = fmpy.read_model_description(_archive(_head(root) if version == "2.0" else root), validate=False)
            types = {kind.name: kind for kind in head.typeDefinitions}
            _check_items(types)
            if version == "2.0":
                variables = [_variable(element, types) for element in root.iterfind("ModelVariables/ScalarVariable")]
            else:
                relative = {
                    element.get("name"): element.get("relativeQuantity") in _TRUE
                    for element in root.iterfind("ModelVariables/*[@relativeQuantity]")
                }
                intermediate = {
                    element.get("name")
                    for element in root.iterfind("ModelVariables/*[@intermediateUpdate]")
                    if element.get("intermediateUpdate") in _TRUE
                }
                variables = [_of_fmpy(variable, relative, intermediate) for variable in head.modelVariables]
        except InputError:
            raise
        # FMPy raises plain Exceptions.
        except Exception as error:
            # Of numbers with too many digits Python names a remedy that is none here.
            reason = str(error).partition("; use sys.")[0] or type(error).__name__
            raise InputError(f"FMPy cannot read it as an FMU ({shortened(reason, 200)})") from None
        _check(variables)
    own = _own(root)
    unit = None if own is None else own.find(f"{{{NAMESPACE}}}Unit")
    return Description(
        version,
        head.guid or "",
        head.generationTool or "",
        _co_simulation(head.coSimulation, version),
        variables,
        _NO_FIELDS if unit is None else {field.get("name"): dict(field.attrib) for field in unit.iter(_FIELD)},
        unit is not None and unit.get("memoryless") == "true",
        head.unitDefinitions,
        head.defaultExperiment,
    )


def _co_simulation(declared: Any, version: str) -> CoSimulation:
    identifier, *abilities = (getattr(declared, name) for name in CoSimulation._fields)
    found = CoSimulation(identifier or "", *map(bool, abilities))
    return found if version == "2.0" else found._replace(canInterpolateInputs=bool(declared.providesIntermediateUpdate))


def _check_items(types: Mapping[str, Any]) -> None:
    """InputError for an enumeration whose items have no numbers."""
    for name, kind in types.items():
        for item in kind.items:
            try:
                int(item.value)
            except (TypeError, ValueError):
                raise InputError(
                    f"the item '{shortened(str(item.name))}' of its type '{shortened(str(name))}' has a "
                    "value that is not a whole number"
                ) from None


def _version(root: Any) -> str:
    """`2.0` or `3.0`; InputError for what cannot be coupled, each kind by its name."""
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version is None:
        raise InputError(
            f"its {DESCRIPTION} describes no FMU (the root is {shortened(root.tag)}, fmiVersion "
            f"{shortened(version or 'not given')})"
        )
    if version.startswith("1."):
        raise InputError("an FMU of FMI 1.0, which is not supported; export it for co-simulation by FMI 2.0 or 3.0")
    if version != "2.0" and not version.startswith("3."):
        raise InputError(f"an FMU of FMI {shortened(version)}, which is not supported; export it by FMI 2.0 or 3.0")
    if root.find("CoSimulation") is not None:
        return "2.0" if version == "2.0" else "3.0"
    for kind, words in (("ModelExchange", "model exchange"), ("ScheduledExecution", "scheduled execution")):
        if root.find(kind) is not None:
            raise InputError(
                f"an FMU for {words} only, which has no solver of its own; export it for co-simulation (CoSimulation)"
            )
    raise InputError("an FMU that is not for co-simulation (it has no CoSimulation); export it for co-simulation")


def _head(root: Any) -> Any:
    """The description without its many variables."""
    head = etree.Element(root.tag, root.attrib)
    for child in root:
        if child.tag in ("ModelVariables", "ModelStructure"):
            etree.SubElement(head, child.tag)
        else:
            head.append(deepcopy(child))
    return head


def _variable(element: Any, types: Mapping[str, Any]) -> Variable:
    value = next((child for child in element if child.tag in _TYPES), None)
    if value is None:
        raise InputError(f"its variable '{shortened(str(element.get('name')))}' has no type")
    causality, variability = element.get("causality", "local"), element.get("variability", "continuous")
    initial = element.get("initial")
    if initial is None and causality != "input":
        initial = "exact" if (variability, causality) in _EXACT else "calculated"
    declared = value.get("declaredType")
    unit = value.get("unit")
    if declared is None:
        kind = None
        relative = value.get("relativeQuantity") in _TRUE
    else:
        kind = types.get(declared)
        if kind is None:
            raise InputError(
                f"its variable '{shortened(str(element.get('name')))}' is of the type '{shortened(declared)}', which "
                "it does not define"
            )
        unit = unit or kind.unit
        relative = value.get("relativeQuantity", "true" if kind.relativeQuantity else "false") in _TRUE
    return Variable(
        element.get("name"),
        int(element.get("valueReference")),
        value.tag,
        causality,
        variability,
        initial,
        unit,
        value.get("start"),
        (),
        relative,
        kind,
    )


def _of_fmpy(variable: Any, relative: Mapping[str, bool], intermediate: Set[str]) -> Variable:
    kind = variable.declaredType
    return Variable(
        variable.name,
        variable.valueReference,
        variable.type,
        variable.causality,
        variable.variability,
        variable.initial,
        variable.unit or (None if kind is None else kind.unit),
        variable.start,
        variable.shape,
        # FMPy 0.3.32 looks for the attribute among the children of the element, and never finds it.
        relative.get(variable.name, bool(kind is not None and kind.relativeQuantity)),
        kind,
        # And this one FMPy never looks for.
        variable.name in intermediate,
    )


def _check(variables: Sequence[Variable]) -> None:
    """InputError for names that are not unique, and for value references and dimensions that no FMU can have."""
    names = {variable.name for variable in variables}
    if len(names) != len(variables):
        seen: set[str] = set()
        for variable in variables:
            if variable.name in seen:
                raise InputError(
                    f"two of its variables are named '{shortened(variable.name)}'; export it with unique names"
                )
            seen.add(variable.name)
    if None in names or "" in names:
        raise InputError("one of its variables has no name")
    references = [variable.valueReference for variable in variables]
    if references and not 0 <= min(references) <= max(references) < _REFERENCES:
        wrong = next(variable for variable in variables if not 0 <= variable.valueReference < _REFERENCES)
        raise InputError(f"its variable '{shortened(wrong.name)}' has no valid value reference: {wrong.valueReference}")
    for variable in variables:
        shape = variable.shape
        if shape and (len(shape) > MOST_DIMENSIONS or min(shape) < 0 or prod(shape) > _MOST_ELEMENTS):
            raise InputError(
                f"its variable '{shortened(variable.name)}' has the shape {quoted(variable.shape)}; dimensions are "
                f"counts, and more than {_MOST_ELEMENTS} elements are refused"
            )


def _own(root: Any) -> Any:
    """This project's element of the FMU's annotations; None in foreign FMUs."""
    for path in ("VendorAnnotations/Tool", "Annotations/Annotation"):
        for element in root.iterfind(path):
            if TOOL in (element.get("name"), element.get("type")):
                return element
    return None


def _archive(root: Any) -> io.BytesIO:
    """An FMU of nothing but a description."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(DESCRIPTION, etree.tostring(root))
    content.seek(0)
    return content


@contextmanager
def _no_collection() -> Iterator[None]:
    """Python's collector would go through all the variables again and again while they are read."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
