"""The part of a model description that a participant needs, cached where reading the description takes long.

A heart's description of FMI 2.0 has up to 60 000 scalars in 10 MB, which make a dozen fields. What was made of them is
kept in the user's cache under a hash of the FMU's file, whoever's FMU it is, and of the code that made it: another FMU
is never taken for it. It is text (JSON) that is only looked up in, and nothing that is run.
"""

import dataclasses
import hashlib
import json
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

from ...fmus.archive import put_in_place
from ...fmus.cache import user_cache
from . import fmu_description, fmu_variables
from .fmu_description import CoSimulation, Described, Description, Variable, read_description
from .fmu_file import FmuFile
from .fmu_variables import Group, groups

#: Variables above which a description is kept; others are read as fast.
_MANY = 1000


@dataclass(frozen=True)
class Digest(Described):
    """A description whose `modelVariables` may lack elements of arrays among inputs and outputs.

    `inputs` and `outputs` are what those are as scalars and arrays, `names` the files in the FMU.
    """

    inputs: Sequence[Group]
    outputs: Sequence[Group]
    names: Collection[str]


def read_digest(file: FmuFile, needed: Collection[str] = (), whole: bool = False) -> Digest:
    """The digest of `file`, with all of its variables if it is to be `whole` or lacks one of those `needed`.

    InputError for an FMU that cannot be coupled, or is none.
    """
    path = _place(file)
    found = None if path is None or whole else _kept(path)
    if found is not None and set(needed) <= {variable.name for variable in found.modelVariables}:
        return found
    digest = _of(read_description(file), file)
    if path is not None and len(digest.modelVariables) > _MANY:
        # What cannot be kept is read again.
        with suppress(OSError):
            _keep(digest, path)
    return digest


def _of(description: Description, file: FmuFile) -> Digest:
    return Digest(
        description.fmiVersion,
        description.guid,
        description.generationTool,
        description.coSimulation,
        description.modelVariables,
        description.fields,
        description.memoryless,
        groups(description.modelVariables, ("input",)),
        groups(description.modelVariables, ("output",)),
        file.names,
    )


def _place(file: FmuFile) -> Path | None:
    """Where the digest of `file` is kept; None for a folder, which is read anew, and without a cache."""
    digest = file.hash()
    if digest is None:
        return None
    try:
        return user_cache() / "descriptions" / f"{digest[:32]}-{_program()[:16]}.json"
    except OSError:
        return None


@cache
def _program() -> str:
    """A hash of what makes a digest."""
    digest = hashlib.sha256(fmpy.__version__.encode())
    for path in (__file__, fmu_description.__file__, fmu_variables.__file__):
        digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def _keep(digest: Digest, path: Path) -> None:
    """Write the digest, without elements of arrays; not at all where one of the others is of a declared type."""
    elements = {name for group in (*digest.inputs, *digest.outputs) for name in group.elements()}
    few = [variable for variable in digest.modelVariables if variable.name not in elements]
    firsts = [group.first for group in (*digest.inputs, *digest.outputs)]
    if any(variable.declaredType is not None for variable in (*few, *firsts)) or len(few) > _MANY:
        return
    content: dict[str, Any] = {field.name: getattr(digest, field.name) for field in dataclasses.fields(digest)}
    content |= {"modelVariables": few, "names": sorted(digest.names)}
    for side in ("inputs", "outputs"):
        content[side] = [group._replace(references=_ranges(group.references)) for group in getattr(digest, side)]
    with put_in_place(path) as part:
        part.write_text(json.dumps(content), encoding="utf-8")


def _kept(path: Path) -> Digest | None:
    """The digest at `path`; None where there is none, or what is there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        for side in ("inputs", "outputs"):
            content[side] = [_group(entry) for entry in content[side]]
        content["coSimulation"] = CoSimulation(*content["coSimulation"])
        content["modelVariables"] = [_variable(entry) for entry in content["modelVariables"]]
        content["names"] = frozenset(content["names"])
        return Digest(**content)
    except (OSError, ValueError, TypeError, KeyError, IndexError):
        return None


def _group(entry: Sequence[Any]) -> Group:
    name, base, shape, first, ranges = entry
    references = [reference for begin, count in ranges for reference in range(begin, begin + count)]
    return Group(name, base, tuple(shape), _variable(first), references)


def _variable(entry: Sequence[Any]) -> Variable:
    variable = Variable(*entry)
    return variable._replace(shape=tuple(variable.shape))


def _ranges(references: Sequence[int]) -> list[tuple[int, int]]:
    """Runs of numbers that follow each other: the first, and how many."""
    runs: list[tuple[int, int]] = []
    for reference in references:
        if runs and reference == sum(runs[-1]):
            runs[-1] = (runs[-1][0], runs[-1][1] + 1)
        else:
            runs.append((reference, 1))
    return runs
