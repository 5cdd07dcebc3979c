"""Scenarios from files and from the command line."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ..errors import InputError
from ..quoting import quoted, shortened
from ..untrusted.yaml_text import LARGEST_TEXT, parse_yaml
from .model import Scenario
from .problem import explained

#: Problems of one file that are told, and characters of those of the command line that are repeated with each.
_MOST_PROBLEMS, _LONGEST_ORIGIN = 20, 300

#: Sections in sections that `--set` can name.
_DEEPEST_KEY = 20

#: A scene has a geometry or a mesh file, and each has keys of its own: whoever sets the one means it instead of the
#: other.
_INSTEAD = {
    "scene.mesh": ("scene.geometry", "scene.mesh_size_mm"),
    "scene.geometry": ("scene.mesh", "scene.boundaries", "scene.scale"),
}

_Model = TypeVar("_Model", bound=BaseModel)


class Contradiction(InputError):
    """Keys that are valid each by itself and cannot stand together: a step that does not divide the run.

    `problem` is the message without the file in front of it.
    """

    def __init__(self, message: str, problem: str) -> None:
        super().__init__(message)
        self.problem = problem


def load_scenario(path: Path, assignments: Sequence[str] = ()) -> Scenario:
    """Read `path` and apply `assignments` (each `key.path=value`); InputError names the key and the remedy."""
    return checked(scenario_content(path), path, assignments)


def scenario_content(path: Path) -> dict[str, Any]:
    """The sections of a scenario file, not validated yet; InputError if it is no file of sections."""
    return file_content(path, "scenario", "`name`, `scene` and `units`", Scenario)


def file_content(path: Path, kind: str, needs: str, model: type[BaseModel]) -> dict[str, Any]:
    """The sections of a file of the `kind` that `model` describes, not validated yet; InputError if it has none.

    `needs` are the keys that it has at least, as they are told of an empty file.
    """
    content = _read(path, kind)
    if content is None:
        raise InputError(f"{path}: the file is empty; a {kind} needs at least {needs}")
    if not isinstance(content, dict):
        raise InputError(
            f"{path}: a {kind} consists of lines `key: value` with the keys {', '.join(model.model_fields)}"
        )
    return content


def checked(content: dict[str, Any], path: Path, assignments: Sequence[str] = ()) -> Scenario:
    """The scenario of a file's `content`, changed by `assignments`; InputError begins with the file's `path`."""
    origin = str(path)
    if assignments:
        origin += " with " + shortened(", ".join(f"--set {text}" for text in assignments), _LONGEST_ORIGIN)
    parsed = [(_parsed(assignment), assignment) for assignment in assignments]
    _remove(content, replaced(dict(setting for setting, _ in parsed)))
    for (key, value), assignment in parsed:
        _place(content, key.split("."), value, f"--set {shortened(assignment, _LONGEST_ORIGIN)}", "--set ")
    return validated(content, Scenario, origin)


def with_settings(content: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of a scenario's `content` with the values of `settings` at their keys (`coupling.step_ms`).

    Keys that these replace are left out (`replaced`).
    """
    changed = dict(content)
    _remove(changed, replaced(settings))
    for key, value in settings.items():
        parts = key.split(".")
        if not _is_key(key, parts):
            raise InputError(f"{quoted(key)}: write a key of a scenario as coupling.step_ms")
        _place(changed, parts, value, quoted(key), "")
    return changed


def replaced(settings: Mapping[str, Any]) -> list[str]:
    """Keys of a scenario that must go where `settings` are put in: a geometry where a mesh is set, and the reverse.

    What the settings name themselves stays, so that setting both is the contradiction that it is in a file.
    """
    if "scene" in settings:
        # The whole section is new: nothing of the file is left in it.
        return []
    named = {".".join(key.split(".")[:2]) for key in settings}
    return [key for new, old in _INSTEAD.items() if settings.get(new) is not None for key in old if key not in named]


def parsed_assignments(assignments: Iterable[str]) -> dict[str, Any]:
    """The values by key of several `key.path=value`; of a key that is named twice the last."""
    return dict(_parsed(assignment) for assignment in assignments)


def _parsed(assignment: str) -> tuple[str, Any]:
    """The key and the value of `key.path=value`; InputError if it is none."""
    key, separator, text = assignment.partition("=")
    parts = [part.strip() for part in key.split(".")]
    told = shortened(assignment, _LONGEST_ORIGIN)
    if not separator or not _is_key(key, parts):
        raise InputError(f"--set {told}: write it as key.path=value, e.g. --set run.stop_ms=100")
    try:
        return ".".join(parts), parse_yaml(text)
    except ValueError as error:
        raise InputError(f"--set {told}: the value is {error}") from None


def _is_key(key: str, parts: Sequence[str]) -> bool:
    return all(parts) and len(parts) <= _DEEPEST_KEY + 1 and key.isprintable()


def validated(content: Mapping[str, Any], model: type[_Model], origin: str) -> _Model:
    """The `model` of `content`; InputError begins with `origin`, and is a Contradiction where no key is wrong alone."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        errors = error.errors()
    problems = list(dict.fromkeys(explained(problem, model) for problem in errors))
    if len(problems) > _MOST_PROBLEMS:
        problems[_MOST_PROBLEMS:] = [f"and {len(problems) - _MOST_PROBLEMS} more problems"]
    together = all(problem["type"] == "value_error" and isinstance(problem["input"], Mapping) for problem in errors)
    message = f"{origin}: " + f"\n{origin}: ".join(problems)
    if together:
        raise Contradiction(message, "; ".join(problems))
    raise InputError(message)


def _read(path: Path, kind: str) -> Any:
    try:
        with path.open("rb") as file:
            return parse_yaml(file.read(LARGEST_TEXT + 1))
    except FileNotFoundError:
        raise InputError(f"{path}: no such {kind} file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: this is a folder; give the {kind}'s YAML file") from None
    except OSError as error:
        raise InputError(f"{path}: the {kind} file cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _remove(content: dict[str, Any], keys: Iterable[str]) -> None:
    """Leave out `section.key`s; their sections are copied, for in YAML two can be one, by an alias."""
    for section, _, last in (key.partition(".") for key in keys):
        if isinstance(found := content.get(section), Mapping):
            content[section] = {key: value for key, value in found.items() if key != last}


def _place(content: dict[str, Any], parts: Sequence[str], value: Any, told: str, option: str) -> None:
    """Put `value` in its place; sections on the way there are copied, for in YAML two can be one, by an alias."""
    *parents, last = parts
    target = content
    for number, parent in enumerate(parents):
        section = target.get(parent)
        if not isinstance(section, dict | None):
            whole = shortened(".".join(parents[: number + 1]))
            raise InputError(
                f"{told}: '{shortened(parent)}' holds {quoted(section)}, not a section; set it as a whole, "
                f"{option}{whole}=..."
            )
        target[parent] = dict(section or {})
        target = target[parent]
    target[last] = value
