"""All sources of numerical error that a scenario has."""

from ...orchestrator.scenario import Scenario
from .coupling_sources import communication, iteration
from .source import Source
from .unit_sources import internal, other_meshes


def sources_of(scenario: Scenario) -> list[Source]:
    """Those in time, in space, and at tolerances."""
    found = [communication(scenario), *internal(scenario), other_meshes(scenario), iteration(scenario)]
    return [source for source in found if source is not None]


def unknown_sources(scenario: Scenario) -> list[str]:
    """Sentences about errors that cannot be told, because nothing is known that would make them smaller."""
    foreign = [name for name, entry in scenario.units.items() if entry.fmu is not None]
    return [
        f"'{name}' is an FMU: the error that it makes inside its steps is unknown and not part of the budget"
        for name in foreign
    ]
