"""The files of a system package: unpacked, found and read, and checked against the schemas of SSP 1.0 or 2.0."""

from collections.abc import Iterator
from functools import cache
from math import isfinite
from os.path import normpath
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import fmpy
from lxml import etree

from ..errors import InputError
from ..quoting import quoted, shortened
from ..untrusted.archive import LARGEST_MEMBER, open_archive
from ..untrusted.document import parse_document
from .vocabulary import NAMESPACES, STRUCTURE

#: Those of parameter mappings are read only.
_NAMESPACES = NAMESPACES | {"ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"}

_SCHEMAS = {
    "ssd": "SystemStructureDescription.xsd",
    "ssv": "SystemStructureParameterValues.xsd",
    "ssm": "SystemStructureParameterMapping.xsd",
}

#: Where the schemas of each version are; FMPy has those of 1.0.
_FOLDERS = {"1.0": Path(fmpy.__file__).parent / "ssp" / "schema", "2.0": Path(__file__).parent / "schemas"}

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
                raise InputError(f"there is no {STRUCTURE} in it, so it is not a system package")
            archive.extract(folder)
    except InputError as error:
        raise InputError(f"cannot be unpacked as a system package: {error}") from None
    return read(folder / STRUCTURE, "ssd", STRUCTURE)


def read(path: Path, kind: str, name: str) -> Any:
    """The root of an XML file of SSP, of the `kind` ssd, ssv or ssm; InputError says what is wrong, and where."""
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
    """InputError if `element` does not follow the schema of its `kind`, in the version of SSP that it names."""
    version = _version(element, name)
    schema = _schema(kind, version)
    if not schema.validate(etree.ElementTree(element)):
        problem = schema.error_log[0]
        message = shortened(problem.message, _LONGEST_PROBLEM)
        raise InputError(f"{name}, line {problem.line}: this does not follow the schema of SSP {version}: {message}")


def _version(element: Any, name: str) -> str:
    """`1.0` or `2.0`; what no file of SSP has, or one without any, is left to the schema of 1.0."""
    text = element.get("version", "1.0")
    if text == "2.0":
        return text
    if not text.startswith("1."):
        raise InputError(
            f"{name}: it is of SSP {shortened(text)}, which is not supported; export it by SSP {' or '.join(_FOLDERS)}"
        )
    return "1.0"


@cache
def _schema(kind: str, version: str) -> Any:
    return etree.XMLSchema(file=str(_FOLDERS[version] / _SCHEMAS[kind]))


def named(element: Any, path: str) -> Iterator[Any]:
    """The elements at `path`, with the prefixes of SSP."""
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
