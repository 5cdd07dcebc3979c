"""The model description of an FMU, read by FMPy but for the many variables of FMI 2.0.

A heart's four FMUs have 113 000 scalars. FMPy makes an object of two dozen attributes of each, which takes three
quarters of the time to set a run up; what the master needs of them is read here, and FMPy is given the rest.
"""

import gc
import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
from lxml import etree

from ..errors import InputError

_MEMBER = "modelDescription.xml"

_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")

#: The initial value's kind where a variable does not say it, by variability; outputs and locals, parameters and inputs
#: (FMI 2.0.4, section 2.2.7).
_EXACT = {("constant", "output"), ("constant", "local"), ("fixed", "parameter"), ("tunable", "parameter")}


class ScalarVariable(NamedTuple):
    """What the master needs of a variable of FMI 2.0; named as in FMPy."""

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


def read_description(path: Path) -> Any:
    """FMPy's model description of the FMU at `path`; InputError if it is none."""
    if not path.is_file():
        raise InputError("no such FMU")
    try:
        with _no_collection(), zipfile.ZipFile(path) as archive:
            root = etree.fromstring(archive.read(_MEMBER), etree.XMLParser(huge_tree=True, resolve_entities=False))
            if root.get("fmiVersion") != "2.0":
                return fmpy.read_model_description(str(path), validate=False)
            variables = [_variable(element) for element in root.iterfind("ModelVariables/ScalarVariable")]
            for part in ("ModelVariables", "ModelStructure"):
                for element in root.iterfind(part):
                    element.clear()
            description = fmpy.read_model_description(_archive(root), validate=False)
            description.modelVariables = variables
            return description
    # FMPy raises plain Exceptions, and those of zip and XML readers.
    except Exception as error:
        raise InputError(f"FMPy cannot read it as an FMU ({error})") from None


def _variable(element: Any) -> ScalarVariable:
    value = next(child for child in element if child.tag in _TYPES)
    causality, variability = element.get("causality", "local"), element.get("variability", "continuous")
    initial = element.get("initial")
    if initial is None and causality != "input":
        initial = "exact" if (variability, causality) in _EXACT else "calculated"
    return ScalarVariable(
        element.get("name"),
        int(element.get("valueReference")),
        value.tag,
        causality,
        variability,
        initial,
        value.get("unit"),
        value.get("start"),
    )


def _archive(root: Any) -> io.BytesIO:
    """An FMU of nothing but a description."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(_MEMBER, etree.tostring(root))
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
