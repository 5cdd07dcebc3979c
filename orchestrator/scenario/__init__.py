"""A scenario: what a person asks for in a YAML file, validated whole before anything runs."""

from .connection_section import ConnectionEntry
from .coupling_section import Coupling, Iterate
from .file import (
    Contradiction,
    checked,
    file_content,
    load_scenario,
    parsed_assignments,
    scenario_content,
    validated,
    with_settings,
)
from .model import Scenario, is_whole
from .rewritten import rewritten
from .scene_section import Scene
from .unit_section import UnitEntry

__all__ = [
    "ConnectionEntry",
    "Contradiction",
    "Coupling",
    "Iterate",
    "Scenario",
    "Scene",
    "UnitEntry",
    "checked",
    "file_content",
    "is_whole",
    "load_scenario",
    "parsed_assignments",
    "rewritten",
    "scenario_content",
    "validated",
    "with_settings",
]
