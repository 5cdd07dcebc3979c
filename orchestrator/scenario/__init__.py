"""A scenario: what a person asks for in a YAML file, validated whole before anything runs."""

from .file import checked, load_scenario
from .model import ConnectionEntry, Coupling, Iterate, Scenario, Scene, UnitEntry

__all__ = [
    "ConnectionEntry",
    "Coupling",
    "Iterate",
    "Scenario",
    "Scene",
    "UnitEntry",
    "checked",
    "load_scenario",
]
