"""Where the results of a run go when nobody says so: `results/<name>`, but never in place of those of other settings.

Where `results/<name>` has a run of other settings, the folder is called by how they differ from that,
`baseline+mesh_size_mm=8`, or by a number, `baseline+2`, where that would be long. A `+` is in no scenario's name, so
that nobody else's folder is called so. A run of the same settings, finished or not, is replaced, or resumed, wherever
it lies.
"""

import json
import re
from collections.abc import Iterator, Mapping
from glob import escape
from itertools import count
from pathlib import Path
from typing import Any

from ..scenario import Scenario
from .checkpoint import checkpoint_scenario
from .lock import is_in_use
from .names import CHECKPOINT, SUMMARY
from .origin import differences, resolved_as_stored

#: Where results go.
RESULTS = Path("results")

#: Keys that a folder's name tells, characters of each value, and bytes of the whole name.
_MOST_KEYS, _LONGEST_VALUE, _LONGEST_NAME = 3, 24, 100

#: Keys that say where something is and not what it is.
_SECTIONS = ("parameters", "start")

#: What no file system minds.
_UNSAFE = re.compile(r"[^\w.,=-]+")


def default_folder(scenario: Scenario, resume: bool = False, root: Path = RESULTS) -> Path:
    """The folder in `root` for the results of `scenario`, or that which to `resume` from; nothing is made or changed.

    A run that was killed before it wrote a checkpoint has left nothing that could be continued or told from others: it
    is replaced. What is being written to by another process is not, unless it has the same settings; that is an error
    which the lock of the folder raises.
    """
    wanted = resolved_as_stored(scenario)
    plain = root / scenario.name
    siblings = sorted(root.glob(f"{escape(scenario.name)}+*"))
    for folder in (plain, *siblings):
        if _scenario_in(folder) == wanted:
            return folder
    if not _is_taken(plain):
        return plain
    # Whoever resumes a run whose scenario has changed learns which keys did.
    if resume and (plain / CHECKPOINT).is_file():
        return plain
    return next(folder for folder in _candidates(plain, wanted) if not _is_taken(folder))


def _candidates(plain: Path, wanted: Mapping[str, Any]) -> Iterator[Path]:
    before = _scenario_in(plain)
    difference = _told(before, wanted) if isinstance(before, Mapping) else None
    begin = plain.name
    if difference is not None and len(f"{begin}+{difference}".encode()) <= _LONGEST_NAME:
        yield plain.with_name(f"{begin}+{difference}")
    for number in count(2):
        yield plain.with_name(f"{begin}+{number}")


def _scenario_in(folder: Path) -> Any:
    """The resolved scenario that the results in `folder` are of; None if there are none of which that is known."""
    try:
        content = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        return content["scenario"]
    # Not there, or not ours.
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return checkpoint_scenario(folder)


def _is_taken(folder: Path) -> bool:
    """Whether something in `folder` must not be replaced: results, whosesoever, or those that somebody writes now."""
    in_place = (folder / SUMMARY, folder / CHECKPOINT)
    return any(path.exists() for path in in_place) or (folder.exists() and not folder.is_dir()) or is_in_use(folder)


def _told(before: Mapping[str, Any], wanted: Mapping[str, Any]) -> str | None:
    """How a scenario differs: `mesh_size_mm=8+scheme=jacobi`; None where that is too much for a name."""
    keys = differences(before, wanted)
    if not 1 <= len(keys) <= _MOST_KEYS:
        return None
    parts = []
    for key, name in zip(keys, _short(keys), strict=True):
        found = [content for content in (wanted, before) if _has(content, key)]
        # A name that has dots in it.
        if not found:
            return None
        # What is not given any more has its default.
        value = _value_text(_at(wanted, key)) if found[0] is wanted else "=default"
        if value is None:
            return None
        parts.append(f"{_UNSAFE.sub('-', name)}{value}")
    return "+".join(parts)


def _short(keys: list[str]) -> list[str]:
    """The last parts of keys, as many as it takes to tell them apart."""
    split = [[part for part in key.split(".") if part not in _SECTIONS] for key in keys]
    for length in range(1, max(map(len, split))):
        names = [".".join(parts[-length:]) for parts in split]
        if len(set(names)) == len(names):
            return names
    return [".".join(parts) for parts in split]


def _at(content: Any, key: str) -> Any:
    """The value at a key; KeyError if there is none."""
    for part in key.split("."):
        if not isinstance(content, Mapping):
            raise KeyError(key)
        content = content[part]
    return content


def _has(content: Any, key: str) -> bool:
    try:
        _at(content, key)
    except KeyError:
        return False
    return True


def _value_text(value: Any) -> str | None:
    """`=` and a value; nothing for a value of several parts; None for one that a name cannot hold."""
    if isinstance(value, Mapping | list):
        return ""
    if value is None or isinstance(value, bool):
        text = {None: "none", True: "true", False: "false"}[value]
    else:
        text = f"{value:g}" if isinstance(value, float) else str(value)
    # Of a path the file.
    safe = _UNSAFE.sub("-", text.rpartition("/")[2]).strip("-.")
    return f"={safe}" if 0 < len(safe) <= _LONGEST_VALUE else None
