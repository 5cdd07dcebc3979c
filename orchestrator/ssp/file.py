"""The files of a system package: unpacked, found and read, and checked against the standard's schemas."""

import zipfile
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import fmpy
from lxml import etree

from ...fmus.ssp import NAMESPACES, STRUCTURE
from ..errors import InputError

_SCHEMAS = {"ssd": "SystemStructureDescription.xsd", "ssv": "SystemStructureParameterValues.xsd"}


def unpack(path: Path, folder: Path) -> Any:
    """Unpack the package at `path` into `folder`, and return the root of its system structure."""
    if not path.is_file():
        raise InputError("no such file")
    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    # What zip readers raise on a file that is none, or damaged.
    except (zipfile.BadZipFile, OSError, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        raise InputError(f"cannot be unpacked as a system package ({error}); write it anew") from None
    if not (folder / STRUCTURE).is_file():
        raise InputError(f"this archive has no {STRUCTURE}, so it is no system package")
    return read(folder / STRUCTURE, "ssd", STRUCTURE)


def read(path: Path, kind: str, name: str) -> Any:
    """The root of an XML file of SSP 1.0, of the `kind` ssd or ssv; InputError says what is wrong, and where."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True, remove_comments=True)
    try:
        root = etree.parse(str(path), parser).getroot()
    except etree.XMLSyntaxError as error:
        raise InputError(f"{name}: no well-formed XML ({error})") from None
    check(root, kind, name)
    return root


def check(element: Any, kind: str, name: str) -> None:
    """InputError if `element` does not follow the schema of its `kind`."""
    schema = _schema(kind)
    if not schema.validate(etree.ElementTree(deepcopy(element))):
        problem = schema.error_log[0]
        raise InputError(f"{name}, line {problem.line}: not as SSP 1.0 has it: {problem.message}")


@cache
def _schema(kind: str) -> Any:
    return etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "ssp" / "schema" / _SCHEMAS[kind]))


def named(element: Any, path: str) -> Iterator[Any]:
    """The elements at `path`, with the prefixes of SSP 1.0."""
    yield from element.iterfind(path, NAMESPACES)


def inside(folder: Path, source: str, what: str) -> Path:
    """The file of the package that the URI `source` refers to; InputError if there is none."""
    relative = PurePosixPath(unquote(source))
    if "://" in source or relative.is_absolute() or ".." in relative.parts:
        raise InputError(f"{what} is at {source}, outside of the package; put it into the package")
    if not (folder / relative).is_file():
        raise InputError(f"{what}, {source}, is not in the package; put it there, or correct the source")
    return folder / relative
