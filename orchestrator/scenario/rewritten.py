"""A scenario file with other settings, for another folder: its own text, comments and order kept."""

import io
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.util import load_yaml_guess_indent

from ..untrusted.yaml_text import parse_yaml
from .file import replaced, scenario_content, validated, with_settings
from .model import Scenario

#: Columns that a line may have: those of the file are not to be broken.
_WIDTH = 100_000

#: The comment that tells editors which schema the file has.
_SCHEMA = re.compile(r"(?P<before>^# yaml-language-server: \$schema=)(?P<path>\S+)", re.MULTILINE)


def rewritten(file: Path, settings: Mapping[str, Any], folder: Path) -> str:
    """The text of the scenario in `file` with `settings` at their keys, and with paths that are relative to `folder`.

    Where the file's text cannot take them as it is (an alias that stands for several sections), the content is written
    anew, without comments. InputError as for a scenario that is loaded.
    """
    own = scenario_content(file)
    wanted = validated(with_settings(own, settings), Scenario, str(file))
    changes = _needed(own, settings, wanted) | _paths(wanted, file.parent, folder)
    content = with_settings(own, changes)
    own_text = _from_folder(file.read_text(encoding="utf-8"), file.parent, folder)
    text = _with(own_text, dict.fromkeys(replaced(changes)) | changes)
    if _same(text, content, file):
        return text
    return _dumped(YAML(), content)


def _needed(content: Mapping[str, Any], settings: Mapping[str, Any], wanted: Scenario) -> dict[str, Any]:
    """The settings without those that change nothing: what the file says already, and defaults."""
    needed = dict(settings)
    for key in settings:
        others = {other: value for other, value in needed.items() if other != key}
        with suppress(ValueError):
            if Scenario.model_validate(with_settings(content, others)).resolved() == wanted.resolved():
                needed = others
    return needed


def _paths(scenario: Scenario, base: Path, folder: Path) -> dict[str, str]:
    """The files that a scenario names, by key, as they are called from `folder`."""
    named = {f"units.{name}.fmu": entry.fmu for name, entry in scenario.units.items()}
    named["scene.mesh"] = None if scenario.scene is None else scenario.scene.mesh
    named["inputs.file"] = None if scenario.inputs is None else scenario.inputs.file
    return {
        key: os.path.relpath(base / path, folder)
        for key, path in named.items()
        if path is not None and not Path(path).is_absolute()
    }


def _from_folder(text: str, base: Path, folder: Path) -> str:
    """The text with the path of its schema, which a comment has for editors, as it is called from `folder`."""

    def moved(match: re.Match[str]) -> str:
        path = match["path"]
        is_elsewhere = "://" in path or Path(path).is_absolute()
        return match[0] if is_elsewhere else f"{match['before']}{os.path.relpath(base / path, folder)}"

    return _SCHEMA.sub(moved, text)


def _with(text: str, settings: Mapping[str, Any]) -> str:
    _, indent, offset = load_yaml_guess_indent(text)
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = _WIDTH
    if indent is not None and offset is not None:
        yaml.indent(mapping=indent, sequence=indent, offset=offset)
    content = yaml.load(text)
    for key, value in settings.items():
        _place(content, key.split("."), value)
    return _dumped(yaml, content)


def _place(content: Any, parts: list[str], value: Any) -> None:
    """Put a value in its place; what is there already stays as it is written, and nothing is said of what is not."""
    *parents, last = parts
    for parent in parents:
        if not isinstance(content.get(parent), Mapping):
            if value is None:
                return
            content[parent] = _flow()
        content = content[parent]
    if value is None:
        content.pop(last, None)
    elif last not in content or content[last] != value:
        content[last] = _flow(value) if isinstance(value, Mapping) else value


def _flow(content: Mapping[str, Any] | None = None) -> CommentedMap:
    """A section in one line."""
    section = CommentedMap(
        {key: _flow(value) if isinstance(value, Mapping) else value for key, value in (content or {}).items()}
    )
    section.fa.set_flow_style()
    return section


def _dumped(yaml: YAML, content: Any) -> str:
    stream = io.StringIO()
    yaml.dump(content, stream)
    return stream.getvalue()


def _same(text: str, content: Mapping[str, Any], file: Path) -> bool:
    """Whether a text is that of a scenario with this content."""
    wanted = validated(content, Scenario, str(file))
    try:
        found = Scenario.model_validate(parse_yaml(text.encode()))
    except ValueError:
        return False
    return found.resolved() == wanted.resolved()
