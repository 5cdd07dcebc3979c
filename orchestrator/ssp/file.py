"""The files of a system package: unpacked, found and read, and checked against the standard's schemas."""

from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from math import isfinite
from os.path import normpath
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import fmpy
from lxml import etree

from ...fmus.ssp import NAMESPACES, STRUCTURE
from ..errors import InputError
from ..quoting import quoted, shortened
from ..untrusted.archive import LARGEST_MEMBER, open_archive
from ..untrusted.document import parse_document

#: Those of parameter mappings are read only.
_NAMESPACES = NAMESPACES | {"ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"}

_SCHEMAS = {
    "ssd": "SystemStructureDescription.xsd",
    "ssv": "SystemStructureParameterValues.xsd",
    "ssm": "SystemStructureParameterMapping.xsd",
}

#: The elements that say which version of the standard they follow.
_VERSIONED = (
    f"{{{_NAMESPACES['ssd']}}}SystemStructureDescription",
    f"{{{_NAMESPACES['ssv']}}}ParameterSet",
    f"{{{_NAMESPACES['ssm']}}}ParameterMapping",
)

#: Characters of a schema's complaint that are repeated; it quotes values of any length.
_LONGEST_PROBLEM = 300


def unpack(path: Path, folder: Path) -> Any:
    """Unpack the package at `path` into `folder`, and return the root of its system structure."""
    try:
        missing = not path.exists()
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror})") from None
    if missing:
        raise InputError("no such file")
    try:
        with open_archive(path) as archive:
            if STRUCTURE not in archive:
                raise InputError(f"there is no {STRUCTURE} in it, so it is no system package")
            archive.extract(folder)
    except InputError as error:
        raise InputError(f"cannot be unpacked as a system package: {error}") from None
    return read(folder / STRUCTURE, "ssd", STRUCTURE)


def read(path: Path, kind: str, name: str) -> Any:
    """The root of an XML file of SSP 1.0, of the `kind` ssd, ssv or ssm; InputError says what is wrong, and where."""
    with path.open("rb") as file:
        content = file.read(LARGEST_MEMBER + 1)
    return parsed(content, kind, name)


def parsed(content: bytes, kind: str, name: str) -> Any:
    """The root of such a file's `content`."""
    if len(content) > LARGEST_MEMBER:
        raise InputError(f"{name}: it has more than {LARGEST_MEMBER / 2**20:.0f} MiB; leave out what is not needed")
    try:
        root = parse_document(content)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    check(root, kind, name)
    return root


def check(element: Any, kind: str, name: str) -> None:
    """InputError if `element` does not follow the schema of its `kind`.

    A file of SSP 2.0 is read if it is one of SSP 1.0 but for its version; what is new in it is refused by its name.
    """
    schema, copied = _schema(kind), deepcopy(element)
    for item in copied.iter(*_VERSIONED):
        if item.get("version") == "2.0":
            item.set("version", "1.0")
    if not schema.validate(etree.ElementTree(copied)):
        problem = schema.error_log[0]
        message = shortened(problem.message, _LONGEST_PROBLEM)
        raise InputError(f"{name}, line {problem.line}: not as SSP 1.0 has it: {message}")


@cache
def _schema(kind: str) -> Any:
    return etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "ssp" / "schema" / _SCHEMAS[kind]))


def named(element: Any, path: str) -> Iterator[Any]:
    """The elements at `path`, with the prefixes of SSP 1.0."""
    yield from element.iterfind(path, _NAMESPACES)


def number(element: Any, attribute: str, default: float, what: str) -> float:
    """A finite number of the standard's type double; InputError begins with `what`."""
    value = float(element.get(attribute, default))
    if not isfinite(value):
        raise InputError(f"{what}: the {attribute} is {value}; a finite number is needed")
    return value


def inside(base: Path, source: str, what: str, package: Path) -> Path:
    """The file of the unpacked `package` that the URI `source` refers to from the folder `base` in it.

    InputError if there is none, or if it would be elsewhere.
    """
    relative = unquote(source)
    path = Path(normpath(base / relative))
    if "://" in source or relative.startswith("/") or not path.is_relative_to(package):
        raise InputError(f"{what} is at {shortened(source)}, outside of the package; put it into the package")
    try:
        found = path.is_file()
    except OSError:
        found = False
    if not found:
        raise InputError(f"{what}, {shortened(source)}, is not in the package; put it there, or correct the source")
    return path


def member(fmu: Path, source: str, what: str) -> bytes:
    """The content of the file in an FMU that the URI `source` refers to."""
    try:
        with open_archive(fmu) as archive:
            return archive.read(unquote(source))
    except InputError as error:
        raise InputError(f"{what}, {quoted(source)} in {fmu.name}: {error}") from None
