"""The package: system structure, parameter sets and FMUs in one archive."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lxml import etree

from ....fmus.archive import add, put_in_place
from ...systems.system import System
from ..vocabulary import STRUCTURE
from .parameter_set import parameter_set
from .structure import parameter_file, structure


def write_ssp(
    system: System, path: Path, annotation: str | None = None, extra: Mapping[str, bytes] | None = None
) -> Path:
    """Write `system` to the file `path` and return it, in SSP 1.0, or in SSP 2.0 if one of its FMUs is of FMI 3.0.

    `annotation` is text that belongs to the whole system, and `extra` are files, by their names in the folder `extra`.

    Raises
    ------
    InputError
        If two FMUs mean different things by the same name of a unit of measure, if a link connects an array of FMI 3.0
        with scalars, or a variable that is given a value does not exist.
    """
    with put_in_place(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        add(archive, STRUCTURE, _text(structure(system, annotation)))
        for component in system.components:
            if component.given:
                add(archive, parameter_file(component), _text(parameter_set(system, component)))
        for fmu, name in system.files.items():
            add(archive, f"resources/{name}", fmu.read_bytes(), zipfile.ZIP_STORED)
        for name, content in (extra or {}).items():
            add(archive, f"extra/{name}", content, zipfile.ZIP_STORED)
    return path


def _text(element: Any) -> bytes:
    text: bytes = etree.tostring(element, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return text
