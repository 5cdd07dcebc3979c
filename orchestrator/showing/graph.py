"""The graph of a scenario: units, the fields between them, and when a unit reads which value.

Within a communication step a unit reads a field that was computed in the same sweep, or one of the last communication
point; in an iterated loop the latter is one of the sweep before. Fields that are exchanged once, at the initialisation,
are read in neither way.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import PurePath

from ..assembly import Assembly
from ..coupling.build import idle
from ..coupling.connections import Connection, Law
from ..coupling.loops import Group, groups_in_order
from ..coupling.master import stepping_order
from ..participants.driven import Driven
from ..participants.participant import Participant, Port
from ..scenario import Scenario


class Reading(Enum):
    """Which value of a field a unit reads."""

    SAME_SWEEP = "value computed in the same sweep"
    BEFORE = "value from before this sweep"
    ONCE = "exchanged once, at the initialisation"
    FILE = "signal from a file"


@dataclass(frozen=True)
class Node:
    """A unit, or a file that drives inputs.

    `place` is that in the order of execution, counted from 1, None for what does not step; units of one place step
    independently of each other. `captions` say what it is. `in_loop`: its outputs come back to its inputs.
    """

    name: str
    captions: tuple[str, ...] = ()
    place: int | None = None
    in_loop: bool = False


@dataclass(frozen=True)
class Edge:
    """A field that flows; `output` and `input` are the names with unit of measure and shape, as they are shown."""

    source: str
    output: str
    target: str
    input: str
    reading: Reading
    in_loop: bool = False


@dataclass(frozen=True)
class Graph:
    """The graph of a scenario; `title` names it, `notes` say how it is coupled, `before` what is read from before."""

    title: str
    notes: tuple[str, ...]
    before: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]


def graph_of(assembly: Assembly) -> Graph:
    """The graph of what was put together; nothing is computed."""
    scenario, participants = assembly.scenario, assembly.participants
    moving = [link for link in assembly.connections if not _is_fixed(link, participants)]
    order = stepping_order(participants, scenario.coupling.order)
    groups = groups_in_order(order, moving)
    rings = [group.units for group in groups if group.is_loop]
    places = _places(scenario, order, groups)
    lazy = idle(participants, assembly.connections)
    # As they are laid out: what feeds the others once, then what steps in its order.
    names = [name for name in participants if name not in places] + sorted(places, key=lambda name: places[name])
    files = list(_of_files(scenario, participants))
    nodes = [Node(file, ("signals",)) for file in dict.fromkeys(edge.source for edge in files)]
    for name in names:
        looped = any(name in ring for ring in rings)
        nodes.append(Node(name, _captions(scenario, name, name in lazy), places.get(name), looped))
    edges = [
        Edge(
            link.source.unit,
            _told(participants[link.source.unit].outputs[link.source.name]),
            link.target.unit,
            f"{link.target.name}{_law(link.law)}",
            _reading(link, moving, places),
            link in moving and any({link.source.unit, link.target.unit} <= set(ring) for ring in rings),
        )
        for link in assembly.connections
    ]
    return Graph(_title(assembly), tuple(_notes(scenario)), _before(scenario), tuple(nodes), (*files, *edges))


def _places(scenario: Scenario, order: Sequence[str], groups: Sequence[Group]) -> dict[str, int]:
    """The places in the order of execution; those who do not wait for each other have the same."""
    coupling = scenario.coupling
    is_parallel = coupling.scheme == "jacobi"
    if coupling.iterate is None:
        return {name: 1 if is_parallel else number for number, name in enumerate(order, 1)}
    # Iterated loops come after what feeds them, and before what they feed.
    steps = [[group.units] if is_parallel else [(unit,) for unit in group.units] for group in groups]
    taken = [units for group in steps for units in group]
    return {name: number for number, units in enumerate(taken, 1) for name in units}


def _reading(link: Connection, moving: Sequence[Connection], places: Mapping[str, int]) -> Reading:
    if link not in moving:
        return Reading.ONCE
    return Reading.SAME_SWEEP if places[link.source.unit] < places[link.target.unit] else Reading.BEFORE


def _of_files(scenario: Scenario, participants: Mapping[str, Participant]) -> Iterator[Edge]:
    """The signals of a file, and what they drive."""
    file = "" if scenario.inputs is None else PurePath(scenario.inputs.file).name
    for name, participant in participants.items():
        if isinstance(participant, Driven):
            for signal in participant.signals:
                yield Edge(file, f"{name}.{signal}", name, _told(participant.inputs[signal]), Reading.FILE)


def _captions(scenario: Scenario, name: str, is_lazy: bool) -> tuple[str, ...]:
    """What a unit is, if its name does not say so, and when it steps, if not always."""
    entry = scenario.units[name]
    what = entry.unit if entry.fmu is None else PurePath(entry.fmu).name
    found = [] if what in (None, name) else [str(what)]
    if is_lazy:
        found.append("at output times only")
    elif entry.every > 1:
        found.append(f"at every {entry.every}. point")
    return tuple(found)


def _told(port: Port) -> str:
    """A field with its unit of measure and its shape: `potential (mV, 1207 nodes)`."""
    places = port.location if port.location in ("node", "element") else ""
    shape = " × ".join(map(str, port.shape))
    if places and port.shape:
        shape = " × ".join([f"{port.shape[0]} {places}{'s' if port.shape[0] != 1 else ''}", *map(str, port.shape[1:])])
    parts = [part for part in (None if port.unit == "1" else port.unit, shape) if part]
    return f"{port.name} ({', '.join(parts)})" if parts else port.name


def _law(law: Law | None) -> str:
    return "" if law is None else f" (× {law.factor:g} + {law.offset:g})"


def _title(assembly: Assembly) -> str:
    scenario, mesh = assembly.scenario, assembly.mesh
    if mesh is None or scenario.scene is None:
        return scenario.name
    scene = scenario.scene
    made = str(scene.geometry) if scene.mesh is None else PurePath(scene.mesh).name
    size = f", {scene.mesh_size_mm:g} mm" if scene.mesh is None and mesh.dimension else ""
    many = f", {mesh.nodes} nodes, {mesh.elements} elements" if mesh.dimension else ""
    return f"{scenario.name}: {made}{size}{many}"


def _notes(scenario: Scenario) -> Iterator[str]:
    coupling = scenario.coupling
    scheme = {"gauss-seidel": "Gauss–Seidel", "jacobi": "Jacobi"}[coupling.scheme]
    steps = f"{coupling.step_ms:g} ms"
    if coupling.adaptive is not None:
        steps = f"{coupling.adaptive.min_ms:g} to {coupling.adaptive.max_ms:g} ms, adaptive"
    kind = "explicit" if coupling.iterate is None else "iterated"
    inputs = {"hold": "held (zero-order hold)", "linear": "linear (first-order hold)"}[coupling.interpolation]
    order = f", extrapolated with order {coupling.extrapolation}" if coupling.extrapolation else ""
    yield f"{kind} {scheme}, communication steps of {steps}; inputs {inputs}{order}"


def _before(scenario: Scenario) -> str:
    """Which value a unit reads of a field that was not computed in the same sweep."""
    if scenario.coupling.iterate is not None:
        return "value of the sweep before, until the loop has converged"
    extrapolated = ", extrapolated" if scenario.coupling.extrapolation else ""
    return f"value of the last communication point{extrapolated}"


def _is_fixed(link: Connection, participants: Mapping[str, Participant]) -> bool:
    source = participants[link.source.unit].outputs[link.source.name]
    return source.fixed or participants[link.target.unit].inputs[link.target.name].fixed
