"""A scenario as a system of FMUs, for tools that have no scenarios."""

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ..fmus.model_description import INPUT_INTERPOLATION
from ..fmus.system import Component, Link, System
from .assembly import called_directly, make_participants
from .coupling.connections import connect
from .errors import InputError
from .participants.fmu_variables import declares_ramps
from .participants.native import Mesh
from .scenario import Scenario

_MS_PER_S = 1000.0

#: The mesh of the scene in a package, where it has one.
MESH = "mesh.npz"


def system_of(scenario: Scenario, base: Path, mesh: Mesh | None, built: Mapping[str, Path]) -> System:
    """The system of `scenario`, whose paths are relative to `base`; `built` are the FMUs of its units by their name.

    Its connections are all that the scenario resolves to, those found by name included. InputError as for a run.
    """
    if scenario.inputs is not None:
        raise InputError("inputs: a system has no place for signals of a file; remove `inputs`")
    with ExitStack() as stack:
        participants = make_participants(stack, called_directly(scenario), base, mesh, described=True)
        connections = connect(participants, scenario.connections, scenario.connect_by_name)
    components = []
    for name, entry in scenario.units.items():
        ports = participants[name]
        given: dict[str, Any] = {**entry.parameters, **entry.start}
        component = Component(
            name,
            built[entry.unit] if entry.unit is not None else base / str(entry.fmu),
            {port.name: port.shape for port in ports.inputs.values()},
            {port.name: port.shape for port in ports.outputs.values()},
            given,
        )
        if scenario.coupling.interpolation == "linear" and declares_ramps(component.description.modelVariables):
            given.setdefault(INPUT_INTERPOLATION, "linear")
        components.append(component)
    links = tuple(
        Link(
            link.source.unit,
            link.source.name,
            link.target.unit,
            link.target.name,
            participants[link.source.unit].outputs[link.source.name].shape,
            None if link.law is None else (link.law.factor, link.law.offset),
        )
        for link in connections
    )
    stop, step = scenario.run.stop_ms / _MS_PER_S, scenario.coupling.step_ms / _MS_PER_S
    return System(scenario.name, tuple(components), links, stop, step)


def beyond_the_standard(scenario: Scenario) -> str:
    """What a system package has no place for, as text: coupling, run, output, rates, and that there is a scene."""
    content: dict[str, Any] = scenario.resolved()
    kept = {key: content[key] for key in ("coupling", "run", "output")}
    kept["every"] = {name: entry.every for name, entry in scenario.units.items() if entry.every != 1}
    if scenario.scene is not None:
        kept["scene"] = {"mesh": f"extra/{MESH}"}
        if scenario.scene.scale is not None:
            # What is packed is in mm, and as sure of it.
            kept["scene"]["scale"] = "mm"
    return json.dumps(kept)
