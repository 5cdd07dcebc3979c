"""What the numbers of a run come from: its scenario, the files it names, this program, and what that computes with."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version
from typing import Any

from ..scenario import Scenario

#: Whose versions the bits of a run may depend on; those that are not installed are not used.
_PACKAGES = (
    "cardiac-cosim",
    "fmpy",
    "gmsh",
    "h5py",
    "meshio",
    "numpy",
    "pyamg",
    "rslab",
    "scikit-fem",
    "scipy",
)

#: The floors of this program, and what of them is read or run.
_FLOORS = ("units", "fmus", "orchestrator")
_KINDS = {".py", ".so", ".msh"}


@dataclass(frozen=True)
class Origin:
    """Two runs of the same origin give the same bits.

    `scenario` is the resolved one; `files` are hashes by the name that the scenario has for a file, None where there
    is none; `program` is a hash of this program's code and kernels.
    """

    scenario: Mapping[str, Any]
    files: Mapping[str, str | None]
    program: str
    versions: Mapping[str, str]

    @classmethod
    def of(cls, scenario: Scenario, base: Path) -> "Origin":
        """The origin of a run of `scenario`, whose paths are relative to `base`, here and now."""
        resolved = resolved_as_stored(scenario)
        files = {name: _hash(base / name) for name in scenario.files()}
        versions = {"python": python_version(), **_versions()}
        return cls(resolved, files, program(), versions)

    @classmethod
    def from_content(cls, content: Any) -> "Origin":
        """The origin that `content` was made of; ValueError if it was made of none."""
        try:
            prints = content["fingerprints"]
            parts = (content["scenario"], prints["files"], content["versions"])
            if not all(isinstance(part, dict) for part in parts) or not all(
                isinstance(value, str) for value in content["versions"].values()
            ):
                raise ValueError("no fingerprints")
            return cls(parts[0], parts[1], str(prints["program"]), parts[2])
        except (KeyError, TypeError):
            raise ValueError("no fingerprints") from None

    def content(self) -> dict[str, Any]:
        """For a file."""
        prints = {"files": dict(self.files), "program": self.program}
        return {"versions": dict(self.versions), "fingerprints": prints, "scenario": dict(self.scenario)}

    def changed_keys(self, earlier: "Origin") -> list[str]:
        """The keys of the scenario that had other values."""
        return differences(earlier.scenario, self.scenario)

    def changes(self, earlier: "Origin") -> list[str]:
        """What else differs, in words, each with its remedy."""
        found = []
        for name in sorted({*earlier.files, *self.files}):
            if earlier.files.get(name) != self.files.get(name):
                gone = self.files.get(name) is None
                found.append(f"{name} {'is missing' if gone else 'has changed since'}; restore it")
        for name in sorted({*earlier.versions, *self.versions}):
            before, now = earlier.versions.get(name), self.versions.get(name)
            if before is None or now is None or _counted(name, before) != _counted(name, now):
                found.append(
                    f"{name} was {before or 'not used'} and is {now or 'not used'}; install the former version"
                )
        if earlier.program != self.program and not found:
            found.append("this program has changed since; use the version that started the run")
        return found


def resolved_as_stored(scenario: Scenario) -> dict[str, Any]:
    """The resolved scenario as it comes back from a file."""
    content: dict[str, Any] = json.loads(json.dumps(scenario.resolved()))
    return content


def _versions() -> dict[str, str]:
    versions = {name: _version(name) for name in _PACKAGES}
    return {name: version for name, version in versions.items() if version is not None}


@cache
def _version(name: str) -> str | None:
    """Of what this process has imported, or would: looking a dozen packages up takes as long as many a step."""
    with suppress(PackageNotFoundError):
        return version(name)
    return None


def _counted(name: str, version: str) -> str:
    """As much of a version as bits may depend on: of Python's the first two numbers."""
    return ".".join(version.split(".")[:2]) if name == "python" else version


def differences(one: Any, other: Any, key: str = "") -> list[str]:
    """The keys at which two resolved scenarios differ, written with dots."""
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            difference
            for name in sorted(one.keys() | other.keys())
            for difference in differences(one.get(name), other.get(name), f"{key}.{name}" if key else name)
        ]
    return [] if one == other else [key]


def _hash(path: Path) -> str | None:
    """Of a file's content, or of all of an FMU in a folder; None where nothing can be read."""
    try:
        if path.is_file():
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        # A folder that no FMU lies in, or a device that has no end, is for nobody to read.
        if not (path / "modelDescription.xml").is_file():
            return None
        members = sorted(member for member in path.rglob("*") if member.is_file())
        return _hash_all({member.relative_to(path).as_posix(): member for member in members})
    # A name that no file can have is a ValueError; whoever reads the file says what is wrong with it.
    except (OSError, ValueError):
        return None


def _hash_all(files: Mapping[str, Path]) -> str:
    digest = hashlib.sha256()
    for name, path in files.items():
        content = path.read_bytes()
        digest.update(f"{name} {len(content)} ".encode() + content)
    return digest.hexdigest()


@cache
def program() -> str:
    """A hash of this program's code and kernels."""
    root = Path(__file__).parents[2]
    files = sorted(path for floor in _FLOORS for path in (root / floor).rglob("*") if path.suffix in _KINDS)
    return _hash_all({path.relative_to(root).as_posix(): path for path in files})
