"""The manifest of FMI-LS-REF: which of an FMU's files are experiments, and which are results.

Three forms are read: that of 1.0.0-beta.1 and of 1.0.0-alpha.1, which differ in the type of a file of experiments only,
and the first draft's, in which the experiments stand in the manifest itself.
"""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from lxml import etree

from ...fmus.reference_members import EXPERIMENTS, NAMESPACE, STANDARD, STATEMENT
from ..errors import InputError
from ..quoting import shortened
from ..untrusted.document import parse_document
from .reference_files import MANIFEST_PATH, ReferenceFiles
from .schema_check import check_manifest

_NAME, _STATEMENT = f"{{{NAMESPACE}}}fmi-ls-name", f"{{{NAMESPACE}}}fmi-ls-description"

#: The types of files of experiments; the second is that of 1.0.0-alpha.1.
EXPERIMENT_TYPES = (EXPERIMENTS, "application/x-ma-ls-experiments")


@dataclass(frozen=True)
class Related:
    """A file that the manifest tells of: its MIME type, its URI, and its role, such as `experiment/smoke-test`."""

    type: str
    source: str
    role: str

    @property
    def main_role(self) -> str:
        """The role without what it is more precisely."""
        return self.role.partition("/")[0]


@dataclass(frozen=True)
class Manifest:
    """All related files, and the elements of experiments that stand in the manifest itself."""

    related: tuple[Related, ...]
    experiments: tuple[Any, ...]


def read_manifest(files: ReferenceFiles) -> Manifest:
    """The manifest in an FMU; InputError where there is none, and for what is wrong with it."""
    if MANIFEST_PATH not in files.names:
        raise InputError(
            f"there are no reference experiments in it (no {MANIFEST_PATH}, FMI-LS-REF), so it cannot be "
            "verified; take an FMU that has some, such as those that `cosim build` makes"
        )
    try:
        root = parse_document(files.read(MANIFEST_PATH))
    except InputError as error:
        raise InputError(f"{MANIFEST_PATH}: {error}") from None
    if root.tag != "fmiReferences" or root.get(_NAME) != STANDARD:
        raise InputError(
            f"{MANIFEST_PATH}: it is not a manifest of {STANDARD}: its root is {shortened(str(root.tag))}, its "
            f"fmi-ls-name {shortened(root.get(_NAME, 'not given'))}"
        )
    experiments = tuple(root.iterfind("Experiment"))
    check_manifest(_strict(root), MANIFEST_PATH)
    related = (
        Related(item.get("type", "application/octet-stream"), item.get("source"), item.get("role"))
        for item in root.iterfind("Related")
    )
    return Manifest(tuple(related), experiments)


def _strict(root: Any) -> Any:
    """A copy of the manifest `root` as the schema wants it.

    The Reference-FMUs leave the standard's statement out, and the first draft has another. Experiments have a schema
    of their own.
    """
    copied = deepcopy(root)
    copied.set(_STATEMENT, STATEMENT)
    for experiment in copied.findall("Experiment"):
        copied.remove(experiment)
    return etree.ElementTree(copied).getroot()
