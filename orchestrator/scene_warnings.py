"""Warnings on a scene, given before anything is computed: on its mesh, its frame, and places that units name."""

from .participants.native import Mesh, mesh_warnings, unit_warnings
from .scenario import Scenario


def scene_warnings(scenario: Scenario, mesh: Mesh | None) -> list[str]:
    """Sentences for a person, of a mesh that has passed all checks."""
    if mesh is None or scenario.scene is None:
        return []
    warnings = mesh_warnings(mesh, scenario.scene)
    for name, entry in scenario.units.items():
        if entry.unit is not None:
            warnings += [f"units.{name}: {text}" for text in unit_warnings(entry.unit, entry.parameters, mesh)]
    return warnings
