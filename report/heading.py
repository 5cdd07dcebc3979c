"""The line that stands above every picture of a run: the scenario's name, and what was changed of its file."""

import json
from collections.abc import Mapping
from typing import Any

from ..orchestrator.results.stored_run import StoredRun

#: Characters of a value, and changed keys, that a heading has room for.
_LONGEST_VALUE, _MOST_KEYS = 40, 4


def heading(name: str, settings: Mapping[str, Any]) -> str:
    """`name`, and the keys in `settings` with their values; keys that say nothing of the scene are left out."""
    told = [f"{_short(key)} = {_value(value)}" for key, value in settings.items() if key != "run.participants"]
    if len(told) > _MOST_KEYS:
        told = [*told[:_MOST_KEYS], f"and {len(told) - _MOST_KEYS} more changes"]
    return f"{name} with {', '.join(told)}" if told else name


def heading_of(run: StoredRun) -> str:
    """The heading of a run that is stored; the folder's name where its summary does not say what it is of."""
    return heading(str(run.summary.get("name", run.folder.name)), run.settings)


def _short(key: str) -> str:
    """A key without the sections that everybody can supply."""
    parts = key.split(".")
    return ".".join(parts[1::2]) if parts[0] == "units" and len(parts) == 4 and parts[2] == "parameters" else key


def _value(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False).replace('"', "")
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 1]}…"
