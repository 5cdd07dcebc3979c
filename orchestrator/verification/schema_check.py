"""The schemas of FMI-LS-REF, which manifests and experiments are checked against; where they are from: `schemas`."""

from functools import cache
from pathlib import Path
from typing import Any

import fmpy
from lxml import etree

from ..errors import InputError
from ..quoting import shortened

_FOLDER = Path(__file__).parent / "schemas"

#: The files of FMI's own schemas that those refer to by their addresses; FMPy has them.
_FMI = Path(fmpy.__file__).parent / "schema" / "fmi3"

#: Characters of a complaint that are repeated; it quotes values of any length.
_LONGEST = 300


def check_manifest(root: Any, name: str) -> None:
    """InputError if the manifest `root` in the file `name` does not follow the schema."""
    _check(root, "fmi3LayeredStandardReferenceManifest.xsd", name)


def check_experiments(root: Any, name: str) -> None:
    """InputError if the experiments `root` in the file `name` do not follow the schema."""
    _check(root, "fmi3LayeredStandardReferenceExperiments.xsd", name)


def _check(root: Any, schema: str, name: str) -> None:
    found = _schema(schema)
    if not found.validate(etree.ElementTree(root)):
        problem = found.error_log[0]
        raise InputError(
            f"{name}, line {problem.line}: this does not follow the schema of FMI-LS-REF: "
            f"{shortened(problem.message, _LONGEST)}"
        )


class _Local(etree.Resolver):  # type: ignore[misc]
    """Finds what a schema refers to among FMPy's files, so that nothing is fetched."""

    def resolve(self, url: str, _identifier: str, context: Any) -> Any:
        path = _FMI / url.rpartition("/")[2]
        return self.resolve_filename(str(path), context) if path.is_file() else None


@cache
def _schema(name: str) -> Any:
    parser = etree.XMLParser(no_network=True)
    parser.resolvers.add(_Local())
    return etree.XMLSchema(etree.parse(str(_FOLDER / name), parser))
