"""Scenarios from files and from the command line."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..quoting import quoted, shortened
from ..untrusted.yaml_text import LARGEST_TEXT, parse_yaml
from .model import Scenario
from .problem import explained

#: Problems of one file that are told, and characters of those of the command line that are repeated with each.
_MOST_PROBLEMS, _LONGEST_ORIGIN = 20, 300

#: Sections in sections that `--set` can name.
_DEEPEST_KEY = 20


def load_scenario(path: Path, assignments: Sequence[str] = ()) -> Scenario:
    """Read `path` and apply `assignments` (each `key.path=value`); InputError names the key and the remedy."""
    content = _read(path)
    if content is None:
        raise InputError(f"{path}: the file is empty; a scenario needs at least `name`, `scene` and `units`")
    if not isinstance(content, dict):
        raise InputError(f"{path}: a scenario is lines `key: value` with the keys {', '.join(Scenario.model_fields)}")
    return checked(content, path, assignments)


def checked(content: dict[str, Any], path: Path, assignments: Sequence[str] = ()) -> Scenario:
    """The scenario of a file's `content`, changed by `assignments`; InputError begins with the file's `path`."""
    for assignment in assignments:
        _assign(content, assignment)
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        problems = list(dict.fromkeys(explained(problem) for problem in error.errors()))
        if len(problems) > _MOST_PROBLEMS:
            problems[_MOST_PROBLEMS:] = [f"and {len(problems) - _MOST_PROBLEMS} more problems"]
        origin = str(path)
        if assignments:
            origin += " with " + shortened(", ".join(f"--set {text}" for text in assignments), _LONGEST_ORIGIN)
        raise InputError(f"{origin}: " + f"\n{origin}: ".join(problems)) from None


def _read(path: Path) -> Any:
    try:
        with path.open("rb") as file:
            return parse_yaml(file.read(LARGEST_TEXT + 1))
    except FileNotFoundError:
        raise InputError(f"{path}: no such scenario file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: this is a folder; give the scenario's YAML file") from None
    except OSError as error:
        raise InputError(f"{path}: the scenario file cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _assign(content: dict[str, Any], assignment: str) -> None:
    key, separator, text = assignment.partition("=")
    *parents, last = [part.strip() for part in key.split(".")]
    told = shortened(assignment, _LONGEST_ORIGIN)
    if not separator or not all((*parents, last)) or len(parents) > _DEEPEST_KEY or not key.isprintable():
        raise InputError(f"--set {told}: write it as key.path=value, e.g. --set run.stop_ms=100")
    try:
        value = parse_yaml(text)
    except ValueError as error:
        raise InputError(f"--set {told}: the value is {error}") from None
    target = content
    for number, parent in enumerate(parents):
        section = target.get(parent)
        if not isinstance(section, dict | None):
            whole = shortened(".".join(parents[: number + 1]))
            raise InputError(
                f"--set {told}: '{shortened(parent)}' holds {quoted(section)}, not a section; set it as a whole, "
                f"--set {whole}=..."
            )
        # A copy: in YAML two sections can be one and the same, by an alias.
        target[parent] = dict(section or {})
        target = target[parent]
    target[last] = value
