"""Adds reference experiments (FMI-LS-REF) to an FMU, as other tools do, and as nobody should."""

import zipfile
from pathlib import Path

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"

_HEAD = (
    '<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" '
    'fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="{version}"{statement}>'
)
_STATEMENT = ' fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU."'
#: The types of a file of experiments, by version of the standard.
TYPES = {"1.0.0-alpha.1": "application/x-ma-ls-experiments", "1.0.0-beta.1": "application/x-ma-hs-experiments"}


def manifest(content: str, version: str = "1.0.0-beta.1", statement: str = _STATEMENT) -> str:
    """A manifest with this content."""
    return f"{_HEAD.format(version=version, statement=statement)}{content}</fmiReferences>"


def related(version: str = "1.0.0-beta.1", role: str = "experiment") -> str:
    """The element that tells of the file of experiments."""
    return f'<Related type="{TYPES[version]}" source="tests.exp" role="{role}"/>'


def experiments(attributes: str, inside: str = '<Stimuli source="in.csv"/><References source="out.csv"/>') -> str:
    """A file of one experiment."""
    return f'<Experiments name="tests"><Experiment name="one" {attributes}>{inside}</Experiment></Experiments>'


def with_files(fmu: Path, destination: Path, files: dict[str, str | None]) -> Path:
    """A copy of `fmu` at `destination` with these files in the standard's folder; None takes one away."""
    named = {f"{FOLDER}/{name}": content for name, content in files.items()}
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(destination, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in source.namelist():
            if name not in named:
                archive.writestr(name, source.read(name))
        for name, content in named.items():
            if content is not None:
                archive.writestr(name, content)
    return destination
