"""A point of a study: one scenario with some settings, to be run once."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..orchestrator.results.origin import Origin
from ..orchestrator.scenario import Scenario

#: Digits of the hash that names a point: enough that no two of any number of points are ever the same.
_DIGITS = 20


@dataclass(frozen=True)
class Point:
    """`scenario`, whose paths are relative to `base`, with the `settings` that make it differ from others."""

    scenario: Scenario
    base: Path
    settings: Mapping[str, Any]

    @cached_property
    def key(self) -> str:
        """The name of the point's folder: a hash of the resolved scenario, of the files it names and of the program."""
        content = json.dumps(Origin.of(self.scenario, self.base).content(), sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:_DIGITS]

    def __str__(self) -> str:
        return told(self.settings)


def told(settings: Mapping[str, Any]) -> str:
    """Settings for a person: `coupling.step_ms=5, coupling.scheme=jacobi`."""
    return ", ".join(f"{key}={value_text(value)}" for key, value in settings.items()) or "as the scenario has it"


def value_text(value: Any) -> str:
    """A setting's value for a person and for a table: as YAML has it, in one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {value_text(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(value_text, value)) + "]"
    return "null" if value is None else str(value)
