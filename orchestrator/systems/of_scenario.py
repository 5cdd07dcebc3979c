"""A scenario as a system of FMUs, for tools that have no scenarios."""

import json
from collections.abc import Callable, Mapping, Sequence, Set
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ..assembly import called_directly, make_participants
from ..coupling.connections import Connection, connect
from ..coupling.master import stepping_order
from ..errors import InputError
from ..participants.native import Mesh
from ..participants.participant import Participant, Ports
from ..scenario import Scenario
from .system import Component, Link, System

_MS_PER_S = 1000.0

#: The mesh of the scene in a package, where it has one.
MESH = "mesh.npz"


def system_of(scenario: Scenario, base: Path, mesh: Mesh | None, built: Mapping[str, Path]) -> System:
    """The system of `scenario`, whose paths are relative to `base`; `built` are the FMUs of its units by their name.

    Its connections are all that the scenario resolves to, those found by name included. InputError as for a run, and
    where elements of an array of FMI 3.0 are connected, which a system has no words for.
    """
    if scenario.inputs is not None:
        raise InputError("inputs: a system description cannot contain signals from a file; remove `inputs`")
    with ExitStack() as stack:
        participants = make_participants(stack, called_directly(scenario), base, mesh, described=True)
        connections = connect(participants, scenario.connections, scenario.connect_by_name)
        order = stepping_order(participants, scenario.coupling.order)
    split = _split(participants, connections)
    components = []
    for name, entry in scenario.units.items():
        if entry.fmu is not None and (base / entry.fmu).is_dir():
            raise InputError(
                f"units.{name}.fmu: {entry.fmu} is a folder; pack it as a file, because a system refers to files"
            )
        ports = participants[name]
        component = Component(
            name,
            built[entry.unit] if entry.unit is not None else base / str(entry.fmu),
            _shapes(ports.inputs, {array for unit, array in split["input"] if unit == name}),
            _shapes(ports.outputs, {array for unit, array in split["output"] if unit == name}),
            {**entry.parameters, **entry.start},
        )
        _check_whole(component, {array for side in split.values() for unit, array in side if unit == name})
        components.append(component)
    links: list[Link] = []
    for link in connections:
        law = None if link.law is None else (link.law.factor, link.law.offset)
        source = participants[link.source.unit].outputs[link.source.name]
        target = participants[link.target.unit].inputs[link.target.name]
        ends = [(source.name, target.name, source.shape)]
        if (link.source.unit, source.name) in split["output"] or (link.target.unit, target.name) in split["input"]:
            ends = [(one, other, ()) for one, other in zip(source.elements, target.elements, strict=True)]
        links += [Link(link.source.unit, one, link.target.unit, other, shape, law) for one, other, shape in ends]
    stop, step = scenario.run.stop_ms / _MS_PER_S, scenario.coupling.step_ms / _MS_PER_S
    first = [name for name in scenario.units if name not in order]
    return System(scenario.name, tuple(components), tuple(links), stop, step, (*first, *order))


def _check_whole(component: Component, split: Set[str]) -> None:
    """InputError if an array that is to be connected by its elements is one variable of the FMU."""
    for array in sorted(split & component.variables.keys()):
        if component.variables[array].dimensions:
            raise InputError(
                f"connections: single elements of the array {component.name}.{array} of FMI 3.0 are connected, or it "
                "is connected to an array of another shape, which a system cannot express; connect whole arrays of "
                "one shape, or take FMUs of FMI 2.0"
            )


def _split(
    participants: Mapping[str, Participant], connections: Sequence[Connection]
) -> dict[str, set[tuple[str, str]]]:
    """The arrays, by unit and name, inputs and outputs apart, of which other tools are told scalar by scalar.

    Those are arrays of which single elements are connected, which are counted from 0, or whose other end is split.
    """
    sides: dict[str, Callable[[Participant], Ports]] = {
        "input": lambda unit: unit.inputs,
        "output": lambda unit: unit.outputs,
    }
    found = {
        side: {
            (name, port.name) for name, unit in participants.items() for port in ports(unit).values() if port.base == 0
        }
        for side, ports in sides.items()
    }
    while True:
        before = sum(map(len, found.values()))
        for link in connections:
            outputs, inputs = participants[link.source.unit].outputs, participants[link.target.unit].inputs
            ends = {
                "output": (link.source.unit, _array(link.source.name, outputs)),
                "input": (link.target.unit, _array(link.target.name, inputs)),
            }
            names = {"output": link.source.name, "input": link.target.name}
            differ = outputs[link.source.name].shape != inputs[link.target.name].shape
            if differ or any(ends[side][1] != names[side] or ends[side] in found[side] for side in sides):
                for side in sides:
                    found[side].add(ends[side])
        if sum(map(len, found.values())) == before:
            return found


def _array(name: str, ports: Ports) -> str:
    """The array that has the element `name`, or `name` itself."""
    place = None if name in ports else ports.place(name)
    return name if place is None else place[0].name


def _shapes(ports: Ports, split: Set[str]) -> dict[str, tuple[int, ...]]:
    """The shapes of ports by name; of those that are `split`, of their elements."""
    shapes: dict[str, tuple[int, ...]] = {}
    for port in ports.values():
        shapes |= dict.fromkeys(port.elements, ()) if port.name in split else {port.name: port.shape}
    return shapes


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
